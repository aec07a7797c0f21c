#!/bin/bash
# setup.sh build|demo|test|bench: installs the Debian packages that are missing for it (as root, or through sudo) and the npm
# packages of the viewer. Quick and without network when all is there. What cannot be installed is named.
set -u
purpose=${1:-build}
cd "$(dirname "$0")/../.." || exit 1

# Compilers and node may come from elsewhere than Debian: they count as present when they can be run.
tools="gcc g++ ar:binutils clang wasm-ld:lld node:nodejs npm"
libraries="libc6-dev libmicrohttpd-dev libdraco-dev libjansson-dev libnifti2-dev zlib1g-dev libbrotli-dev"
wanted="binaryen"                           # what the purpose can do without
case $purpose in
build) ;;
demo) wanted="$wanted mricron-data" ;;
test) tools="$tools curl brotli chromium" libraries="$libraries libcgal-dev libgmp-dev libmpfr-dev mricron-data" ;;
bench) tools="$tools python3" libraries="$libraries mricron-data python3-vtk9 python3-numpy python3-nibabel"
    libraries="$libraries libmeshoptimizer-dev libzstd-dev libcgal-dev libgmp-dev libmpfr-dev" ;;
*) echo "usage: setup.sh build|demo|test|bench" >&2; exit 2 ;;
esac

installed() { dpkg-query -W -f '${db:Status-Abbrev}' "$1" 2>/dev/null | grep -q '^.i'; }

missing_packages() {
    local tool library major
    for tool in $tools; do command -v "${tool%%:*}" >/dev/null 2>&1 || echo "${tool##*:}"; done
    for library in $libraries; do installed "$library" || echo "$library"; done
    # Clang's run-time libraries are named by its version; both the builtins for wasm32 and libFuzzer are looked for as files.
    if command -v clang >/dev/null 2>&1; then
        major=$(clang -dumpversion | cut -d. -f1)
        find -L "$(clang -print-resource-dir)/lib" -name 'libclang_rt.builtins*wasm32*.a' 2>/dev/null | grep -q . ||
            echo "libclang-rt-$major-dev-wasm32"
        if [ "$purpose" = test ]; then
            find -L "$(clang -print-resource-dir)/lib" -name 'libclang_rt.fuzzer*' 2>/dev/null | grep -q . ||
                echo "libclang-rt-$major-dev"
        fi
    fi
}
missing_wanted() { for library in $wanted; do installed "$library" || echo "$library"; done; }

as_root=""
if [ "$(id -u)" != 0 ]; then as_root="sudo"; fi
updated=no
install() {                                 # packages...: 0 when all are installed
    command -v apt-get >/dev/null 2>&1 || return 1
    if [ -n "$as_root" ] && ! command -v sudo >/dev/null 2>&1; then return 1; fi
    if [ $updated = no ]; then
        updated=yes
        $as_root apt-get -q update >&2 || true
    fi
    # shellcheck disable=SC2086
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get -q -y --no-install-recommends install "$@" </dev/null >&2
}

# Twice: the run-time libraries are known only when clang is there.
for _ in 1 2; do
    need=$(missing_packages | sort -u)
    [ -z "$need" ] && break
    echo "Installing:" $need >&2
    # One by one when not all at once, so that only what is really not to be had is named below.
    install $need || for package in $need; do install "$package" || true; done
done
need=$(missing_packages | sort -u)
if [ -n "$need" ]; then
    echo "setup: missing Debian packages: $(echo $need)" >&2
    echo "setup: as root: apt-get update && apt-get install $(echo $need)" >&2
    exit 1
fi
extra=$(missing_wanted)
if [ -n "$extra" ]; then install $extra || echo "setup: not to be had: $(echo $extra)" >&2; fi

stamp=web/node_modules/.package-lock.json
if [ -f web/package-lock.json ] && { [ ! -f $stamp ] || [ web/package-lock.json -nt $stamp ]; }; then
    echo "Installing the npm packages of the viewer" >&2
    if ! (cd web && npm ci --no-audit --no-fund --loglevel=error >&2); then
        echo "setup: npm ci failed in web/: it needs the npm registry once" >&2
        exit 1
    fi
    touch $stamp
fi
