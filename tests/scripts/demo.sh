#!/bin/bash
# Bakes the demonstration models into build/demo/ (only what is out of date) and serves them. Run by `make demo`.
set -eu
cd "$(dirname "$0")/../.."
lathe=build/lathe
data=${LATHE_DEMO_DATA:-/usr/share/mricron/templates}
port=${PORT:-8080}
bind=${BIND:-127.0.0.1}
mkdir -p build/demo

bake() {                                    # OUT INPUT options...
    local out=$1 input=$2
    shift 2
    if [ "$out" -nt "$input" ] && [ "$out" -nt $lathe ]; then return; fi
    echo "Baking $(basename "$input")"
    $lathe bake "$input" -o "$out" "$@"
}

models=()
if [ -f "$data/ch2bet.nii.gz" ] && [ -f "$data/aal.nii.gz" ]; then
    bake build/demo/ch2bet.lathe "$data/ch2bet.nii.gz" --iso 46.5
    bake build/demo/aal.lathe "$data/aal.nii.gz" --labels all
    models=(build/demo/ch2bet.lathe build/demo/aal.lathe)
else
    echo "The scans of the package mricron-data are not here: a computed phantom takes their place."
    make --no-print-directory build/release/tests/make_phantom
    [ -f build/demo/phantom.json ] || build/release/tests/make_phantom knot build/demo/phantom.json 112
    bake build/demo/phantom.lathe build/demo/phantom.json --iso 0
    models=(build/demo/phantom.lathe)
fi

echo
echo "Open http://$bind:$port/ in a browser (Ctrl-C stops the server)."
exec $lathe serve "${models[@]}" --port "$port" --bind "$bind"
