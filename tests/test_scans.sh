#!/bin/bash
# Real scans, end to end: a brain and an atlas of 116 labels are baked, verified against their voxels, looked at by CGAL, and
# their levels must fall in error as promised. Needs the scans of Debian's mricron-data.
set -u
cd "$(dirname "$0")/.." || exit 1
lathe=${LATHE_BIN:-build/lathe}
programs=${LATHE_BUILD:-build/release}/tests
data=${LATHE_DEMO_DATA:-/usr/share/mricron/templates}
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
passed=0 failed=0
ok() {
    local what=$1
    shift
    if "$@" >"$here/said" 2>&1; then passed=$((passed + 1)); else failed=$((failed + 1)); echo "failed: $what" >&2; tail -n 20 "$here/said" >&2; fi
}
json() { node -e 'const j = JSON.parse(require("fs").readFileSync(process.argv[1])); if (!eval(process.argv[2])) { console.log(JSON.stringify(j.levels)); process.exit(1) }' "$@"; }

ok "bake ch2bet" "$lathe" bake "$data/ch2bet.nii.gz" --iso 46.5 -o "$here/ch2bet.lathe"
ok "bake aal" "$lathe" bake "$data/aal.nii.gz" --labels all --no-draco -o "$here/aal.lathe"
for scan in ch2bet aal; do
    ok "verify $scan" "$lathe" verify "$here/$scan.lathe" "$data/$scan.nii.gz"
    "$lathe" info --json "$here/$scan.lathe" >"$here/$scan.info"
    ok "$scan: RMS falls by 1.5 or more" json "$here/$scan.info" 'j.levels.every((l, i, all) => !i || all[i - 1].error_rms_mm >= 1.5 * l.error_rms_mm)'
    ok "$scan: level 0 has at most 1/8 of the bytes" json "$here/$scan.info" '8 * j.levels[0].polar_bytes <= j.levels.reduce((sum, l) => sum + l.polar_bytes, 0)'
    ok "$scan: the structures' bytes add up to the stream" json "$here/$scan.info" \
        'j.structures.flatMap(s => s.levels).reduce((sum, l) => sum + l.polar_bytes, 0) === j.levels.reduce((sum, l) => sum + l.polar_bytes, 0)'
done
fine='const fine = limit => { let sum = 0; for (const l of j.levels) { sum += l.polar_bytes; if (l.error_rms_mm <= 0.25) return sum <= limit } return false };'
ok "ch2bet: a quarter voxel in 50 KB" json "$here/ch2bet.info" "$fine fine(50000)"
ok "aal: a quarter voxel in 113 KB" json "$here/aal.info" "$fine fine(113000)"
ok "ch2bet: 5 levels or more" json "$here/ch2bet.info" 'j.levels.length >= 5'
ok "ch2bet: last level" json "$here/ch2bet.info" '(l => l.error_rms_mm <= 0.15 && l.error_max_mm <= 1.5)(j.levels.at(-1))'
ok "aal: last level" json "$here/aal.info" '(l => l.error_rms_mm <= 0.25 && l.error_max_mm <= 2)(j.levels.at(-1))'
ok "aal: names from the table" json "$here/aal.info" 'j.structures.length === 116 && j.structures.some(s => s.name === "Thalamus_L")'

# An independent look at every level of every structure. The files have 32 bit floats in mm: rounding to them must do no harm.
if [ -x "$programs/cgal_check" ]; then
    all_pass() {                            # SCAN LEVEL: every structure that has the level
        local scan=$1 level=$2 name
        node -e 'const j = JSON.parse(require("fs").readFileSync(process.argv[1]));
            for (const s of j.structures) if (s.levels.length > process.argv[2]) console.log(s.name)' "$here/$scan.info" "$level" >"$here/names"
        [ -s "$here/names" ] || return 1
        while read -r name; do
            "$lathe" export "$here/$scan.lathe" --level "$level" --structure "$name" -o "$here/one.stl" || return 1
            "$programs/cgal_check" "$here/one.stl" || { echo "$name"; return 1; }
        done <"$here/names"
    }
    for level in 0 1 2 3 4; do
        ok "CGAL: ch2bet at level $level is closed and does not intersect itself" all_pass ch2bet $level
        ok "CGAL: every structure of aal at level $level too" all_pass aal $level
    done
fi
ok "wasm builds the same meshes" node -e '
    const { execFileSync } = require("child_process");
    for (const scan of ["ch2bet", "aal"]) {
        const file = `${process.argv[2]}/${scan}.lathe`;
        const wasm = JSON.parse(execFileSync("node", ["tests/bench/decode_wasm.mjs", file])).hashes.join();
        if (wasm !== execFileSync(process.argv[1], ["hash", "--each", file], { encoding: "utf8" }).split(/\s+/).filter(Boolean).join()) throw Error(scan);
    }' "$lathe" "$here"

echo "$passed passed, $failed failed"
[ $failed = 0 ]
