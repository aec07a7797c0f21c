#!/bin/bash
# The command line: every command, its exit status, its files, and what it says when something is wrong.
# Needs LATHE_BIN and LATHE_PHANTOM (the programs); tests/scripts/run_tests.sh sets them.
set -u
cd "$(dirname "$0")/.." || exit 1
lathe=${LATHE_BIN:-build/lathe}
phantom=${LATHE_PHANTOM:-build/release/tests/make_phantom}
programs=${LATHE_BUILD:-build/release}/tests
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
passed=0 failed=0

ok() {                                      # WHAT CONDITION...
    local what=$1
    shift
    if "$@" >/dev/null 2>&1; then passed=$((passed + 1)); else failed=$((failed + 1)); echo "failed: $what" >&2; fi
}
exits() {                                   # STATUS ARGUMENTS...: runs lathe; output in $here/out and $here/err
    local want=$1 got=0
    shift
    timeout 120 "$lathe" "$@" >"$here/out" 2>"$here/err" </dev/null || got=$?
    if [ $got = "$want" ]; then passed=$((passed + 1)); else
        failed=$((failed + 1))
        echo "failed: lathe $* -> $got, not $want: $(head -c 400 "$here/err")" >&2
    fi
}
says() { ok "says \"$1\": $(head -c 200 "$here/err")" grep -q -- "$1" "$here/err"; }
prints() { ok "prints \"$1\"" grep -q -- "$1" "$here/out"; }
json() { node -e 'const j = JSON.parse(require("fs").readFileSync(process.argv[1])); if (!eval(process.argv[2])) process.exit(1)' "$@"; }

# ---- usage ----
exits 2
exits 0 --help; prints "lathe COMMAND"
exits 0 --version; prints "^lathe [0-9]"
exits 2 nonsense; says "no such command"
for command in bake serve info export verify bench hash reconstruct draw; do exits 0 $command --help; prints "^Usage: lathe $command"; done
exits 2 bake
exits 2 info
exits 2 info a b
exits 2 info --nonsense x; says "unknown option --nonsense"
exits 2 bake x.json --iso; says "needs a value"
exits 2 bake x.json --iso many; says "a number is needed"
exits 2 bake x.json --iso nan
exits 2 bake x.json --iso 1 --label 2; says "only one of"
exits 2 bake x.json --label 1.5
exits 2 bake x.json --labels 1,,2
exits 2 bake x.json --axis w
exits 2 bake x.json --boundary round
exits 2 bake x.json --topology round
exits 2 bake x.json --quiet=yes; says "takes no value"
exits 2 export x.lathe; says "-o OUT is needed"
exits 2 export x.lathe -o x.txt; says "stl, ply, glb or drc"
exits 2 serve --port 99999
exits 2 bench decode
exits 2 bench encode x
exits 1 info "$here/none.lathe"; says "none.lathe"
exits 1 bake "$here/none.nii"; says "none.nii"
exits 1 bake "$here/none.txt"
exits 1 verify "$here/none.lathe"

# ---- bake and what reads it ----
"$phantom" ball "$here/ball.json" 24
"$phantom" labels "$here/labels.json" 40
"$phantom" values "$here/values.json" 32
printf '1 Ball\n2 Box\n3 Ring\n' >"$here/labels.txt"
exits 0 bake "$here/ball.json" --iso 128 -o "$here/ball.lathe"; prints "1 structure,"
ok "stderr is no terminal: no bar" test ! -s "$here/err"
exits 0 bake "$here/values.json" -o "$here/values.lathe"; says "Otsu"
exits 0 bake "$here/values.json" --iso=100 --boundary edge --axis x --name "A B" --no-errors --no-draco --quiet -o "$here/edge.lathe"
ok "quiet is quiet" test ! -s "$here/out"
exits 0 bake "$here/labels.json" --labels all --json -o"$here/labels.lathe"
ok "bake --json" json "$here/out" 'j.structures.length === 3'
exits 0 bake "$here/labels.json" --label 2 -o "$here/box.lathe"
exits 0 bake "$here/labels.json" --labels 1,3 -o "$here/two.lathe"
exits 1 bake "$here/labels.json" --label 9 -o "$here/no.lathe"; says "lathe: "
exits 1 bake "$here/ball.json" --iso 300 -o "$here/no.lathe"
ok "a failed bake leaves nothing" test -z "$(find "$here" -name '*no.lathe*')"
exits 1 bake "$here/ball.json" -o "$here/nowhere/x.lathe"
(cd "$here" && "$OLDPWD/$phantom" ball default.json 12 2>/dev/null || "$phantom" ball default.json 12
 case $lathe in /*) "$lathe" bake default.json >/dev/null 2>&1 ;; *) "$OLDPWD/$lathe" bake default.json >/dev/null 2>&1 ;; esac)
ok "default output" test -s "$here/default.lathe"
exits 0 bake "$here/ball.json" --iso 128 -o "$here/again.lathe"
ok "baking twice gives the same bytes" cmp "$here/ball.lathe" "$here/again.lathe"

exits 0 info "$here/labels.lathe"; prints "triangles"
exits 0 info --json "$here/ball.lathe"
cp "$here/out" "$here/ball.info"
ok "info: the keys" json "$here/out" 'j.structures.every(s => typeof s.name === "string" && s.levels.every((l, i) => l.level === i &&
    ["rays", "slices", "vertices", "triangles", "polar_bytes", "draco_bytes"].every(k => Number.isInteger(l[k])) &&
    typeof l.error_max_mm === "number" && typeof l.error_rms_mm === "number"))'
ok "info: levels rise" json "$here/out" 'j.structures[0].levels.length >= 2 && j.structures[0].levels.every((l, i, all) => !i ||
    (l.triangles > all[i - 1].triangles && l.slices >= all[i - 1].slices && l.error_rms_mm < all[i - 1].error_rms_mm))'
exits 0 info --json "$here/edge.lathe"
exits 0 bake "$here/values.json" --topology keep --no-draco -o "$here/keep.lathe"
exits 0 verify "$here/keep.lathe" "$here/values.json"; prints "topology of every level compared"
exits 0 info --json "$here/keep.lathe"
ok "info: nothing waits where the topology is kept" json "$here/out" 'j.topology === "keep" &&
    j.structures[0].levels.every(l => l.components > 0 && l.components_waiting === 0 && l.waiting_mm3 === 0)'
exits 0 info --json "$here/edge.lathe"
ok "info: errors that were not measured are null" json "$here/out" 'j.structures[0].levels.every(l => l.error_max_mm === null)'
exits 0 info "$here/ball.lathe" --json; prints '"structures"'

exits 0 verify "$here/ball.lathe"; prints "passed"
for model in ball values labels box two; do
    volume=$model
    case $model in box | two) volume=labels ;; esac
    exits 0 verify "$here/$model.lathe" "$here/$volume.json"; prints "passed"
done
exits 0 verify "$here/edge.lathe" "$here/values.json"
exits 0 verify --json "$here/labels.lathe" "$here/labels.json"
ok "verify --json" json "$here/out" 'j.passed && j.structures.length === 3 && j.structures.every(s => s.voxels.components === 1)'
ok "the ring has Euler characteristic 0, ball and box 2" json "$here/out" 'j.structures.map(s => s.levels.at(-1).euler).join() === "2,2,0"'
exits 1 verify "$here/ball.lathe" "$here/values.json"   # another topology: a shell
exits 1 verify "$here/labels.lathe" "$here/none.json"

# ---- export ----
ring=$(node -p 'JSON.parse(require("fs").readFileSync(process.argv[1])).structures.at(-1).name' <("$lathe" info --json "$here/labels.lathe"))
for format in stl ply glb drc; do
    exits 0 export "$here/labels.lathe" --level 0 -o "$here/all.$format"
    exits 0 export "$here/labels.lathe" --structure "$ring" -o "$here/ring.$format"
    exits 0 export "$here/labels.lathe" --structure "$ring" --level last --format $format -o -
    ok "standard output gets the same $format" cmp "$here/out" "$here/ring.$format"
done
triangles=$(node -p 'JSON.parse(require("fs").readFileSync(process.argv[1])).structures.at(-1).levels.at(-1).triangles' <("$lathe" info --json "$here/labels.lathe"))
ok "STL has 84 + 50 n bytes" test "$(stat -c %s "$here/ring.stl")" = $((84 + 50 * triangles))
ok "PLY" grep -aq "^ply" "$here/ring.ply"
ok "GLB" grep -aq "^glTF" "$here/ring.glb"
ok "Draco" grep -aq "^DRACO" "$here/ring.drc"
exits 0 export "$here/labels.lathe" --level 0 -o "$here/flat.stl"
exits 0 export "$here/labels.lathe" --level 0 --smooth 3 -o "$here/smooth.stl"
flat=$(od -An -tu4 -j 80 -N 4 "$here/flat.stl"); smooth=$(od -An -tu4 -j 80 -N 4 "$here/smooth.stl")
ok "--smooth 3 cuts every triangle into nine" test $((flat * 9)) = $((smooth))
exits 2 export "$here/labels.lathe" --smooth 0 -o "$here/no.stl"; says "1 to 16"
exits 2 export "$here/labels.lathe" --smooth 17 -o "$here/no.stl"; says "1 to 16"
exits 1 export "$here/labels.lathe" --level 99 -o "$here/no.stl"; says "the last one is"
exits 2 export "$here/labels.lathe" --level -1 -o "$here/no.stl"
exits 1 export "$here/labels.lathe" --structure nobody -o "$here/no.stl"; says "no structure"
exits 1 export "$here/labels.lathe" -o "$here/nowhere/no.stl"
ok "a failed export leaves nothing" test -z "$(find "$here" -name '*no.stl*')"

# Third parties: CGAL and Draco's own decoder, where the check programs are built; Khronos' validator where npm brought it.
if [ -x "$programs/cgal_check" ]; then
    for model in ball values box; do
        "$lathe" export "$here/$model.lathe" -o "$here/$model.stl" 2>/dev/null
        ok "CGAL finds $model closed and free of self-intersections" "$programs/cgal_check" "$here/$model.stl"
    done
fi
if [ -x "$programs/draco_check" ]; then
    for mesh in all ring; do ok "Draco decodes what STL has: $mesh" "$programs/draco_check" "$here/$mesh.drc" "$here/$mesh.stl"; done
fi
ok "glTF validator" node tests/gltf_validate.mjs "$here/all.glb" "$here/ring.glb"

# ---- contour sets ----
set=tests/data/y_with_hole.json
for options in "" "--branching paper" "--branching paper --links paper --mid-slices wide" "--tiling toroidal" "--tiling christiansen" \
    "--tiling shortest --hierarchy 0.3" "--smooth 3"; do
    # shellcheck disable=SC2086
    exits 0 reconstruct $set $options -o "$here/y.stl"; prints "free of self-intersections"
    if [ -x "$programs/cgal_check" ] && [ "$options" != "--smooth 3" ]; then ok "CGAL: reconstruct $options" "$programs/cgal_check" "$here/y.stl"; fi
done
for format in ply glb drc; do exits 0 reconstruct $set --quiet -o "$here/y.$format"; done
exits 0 reconstruct "$here/ball.json" --iso 128 -o "$here/ball.ply"; prints "components 1, Euler characteristic 2"
exits 0 reconstruct "$here/labels.json" --label 3 --branching paper -o "$here/ring.ply"; prints "components 1, Euler characteristic 0"
exits 0 bake $set -o "$here/y.lathe"; says "voxels of"
exits 0 bake $set --spacing 0.7 -o "$here/y.lathe"; says "0.7 mm"
exits 0 verify "$here/y.lathe"; prints "passed"
exits 1 bake $set --spacing 0.0001 -o "$here/no.lathe"
exits 2 reconstruct $set
exits 2 reconstruct $set -o x.stl --tiling best; says "it is one of trees"
exits 2 reconstruct $set -o x.stl --rays 12; says "power of two"
exits 1 reconstruct "$here/none.json" -o "$here/no.stl"
echo '{"sections":[{"z":0,"polygons":[[[0,0],[9,9],[9,0],[0,9]]]}]}' >"$here/bow.json"
exits 1 reconstruct "$here/bow.json" -o "$here/no.stl"; says "section 0, polygon 0"

# ---- drawings: a star-shaped contour has one FOR edge for each ray ----
svg=$here/section.svg
exits 0 draw $set --slice 0 --rays 32 -o "$svg"; ok "title" grep -q "<title>y_with_hole, section 0 at 0 mm, loop 0 of 2, 32 rays" "$svg"
ok "32 FOR edges" test "$(grep -c 'class="for"' "$svg")" = 32
exits 0 draw $set --slice 1 --loop 1 -o "$svg"; ok "hole" grep -q "section 1 at 3 mm, hole, loop 1 of 2, 16 rays" "$svg"
exits 0 draw "$here/ball.json" --iso 128 --slice 8 -o "$svg"; ok "slice" grep -q "<title>ball, slice 8 across z, loop 0 of 1, 16 rays" "$svg"
ok "16 FOR edges" test "$(grep -c 'class="for"' "$svg")" = 16
exits 1 draw $set --slice 99 -o "$here/no.svg"; says "the set has sections 0 to"
exits 1 draw $set --slice 0 --loop 2 -o "$here/no.svg"; says "section 0 at 0 mm has 2 loops"
exits 2 draw $set --slice 0 --iso 1 -o "$here/no.svg"; says "are for volumes"
exits 1 draw "$here/bow.json" --slice 0 -o "$here/no.svg"; says "section 0, polygon 0"

# ---- bench and hash ----
exits 0 hash "$here/ball.lathe"; prints "^[0-9a-f]\{16\}$"
hash=$(cat "$here/out")
exits 0 hash --each "$here/labels.lathe"; ok "three hashes" test "$(wc -l <"$here/out")" = 3
exits 0 bench decode "$here/ball.lathe" --json --repeat 1
ok "bench --json, same hash" json "$here/out" "j.hash === '$hash' && j.triangles > 0"
exits 0 bench decode "$here/ball.lathe" --repeat 1; prints "M triangles/s"

# ---- bad input ----
size=$(stat -c %s "$here/ball.lathe")
head -c $((size / 2)) "$here/ball.lathe" >"$here/half.lathe"
for command in info verify hash "bench decode"; do exits 1 $command "$here/half.lathe"; says "half.lathe"; done
head -c 3000 /dev/urandom >"$here/noise.lathe"
exits 1 info "$here/noise.lathe"
: >"$here/empty.lathe"
exits 1 info "$here/empty.lathe"
exits 1 info "$here"
# Every tenth byte of the archive flipped: found, or without consequence (never a crash: exit 0 or 1).
crashed=0 unnoticed=0
for ((at = 0; at < size && at < 4000; at += 37)); do
    cp "$here/ball.lathe" "$here/flip.lathe"
    byte=$(od -An -tu1 -j $at -N1 "$here/flip.lathe")
    printf "\\x$(printf %02x $((byte ^ 0x55)))" | dd of="$here/flip.lathe" bs=1 seek=$at conv=notrunc 2>/dev/null
    status=0
    timeout 60 "$lathe" verify --no-intersections "$here/flip.lathe" >/dev/null 2>&1 || status=$?
    [ $status -gt 1 ] && crashed=$((crashed + 1)) && echo "byte $at flipped: exit $status" >&2
    [ $status = 0 ] && unnoticed=$((unnoticed + 1)) && echo "byte $at flipped: not noticed" >&2
done
ok "no flipped byte crashes" test $crashed = 0
ok "every flipped byte is noticed" test $unnoticed = 0

# ---- output that cannot be written ----
status=0; "$lathe" info "$here/ball.lathe" >/dev/full 2>"$here/err" || status=$?
ok "a full standard output" test $status = 1; says "standard output"
status=0; "$lathe" info "$here/ball.lathe" >&- 2>"$here/err" || status=$?
ok "a closed standard output" test $status = 1; says "standard output"
status=0; "$lathe" export "$here/ball.lathe" --format stl -o - >/dev/full 2>"$here/err" || status=$?
ok "an export to a full disk" test $status = 1
# A full disk: a file size limit makes writes fail in the same way (SIGXFSZ ignored).
status=0
(ulimit -f 0; trap '' XFSZ; "$lathe" bake "$here/values.json" --iso 100 -o "$here/full.lathe" >/dev/null 2>/dev/null) || status=$?
ok "a bake onto a full disk fails" test $status = 1
ok "and leaves nothing" test -z "$(find "$here" -name '*full.lathe*')"

# ---- serve: a port in use, a volume baked on the way, a clean end ----
if command -v curl >/dev/null 2>&1; then
    cat "$here/ball.json" >"$here/on the way.json"
    "$lathe" serve "$here/labels.lathe" "$here/on the way.json" --iso 128 --port 0 >"$here/serve.out" 2>"$here/serve.err" </dev/null &
    server=$!
    for _ in $(seq 100); do grep -q listening "$here/serve.out" && break; sleep 0.1; done
    address=$(sed -n 's/^listening on \(.*\)$/\1/p' "$here/serve.out")
    ok "serve lists both" bash -c "curl -sf $address/models | grep -q labels"
    ok "healthz" curl -sf "$address/healthz"
    exits 1 serve "$here/labels.lathe" --port "${address##*:}"; says "${address##*:}"
    kill -TERM $server
    (sleep 30; kill -KILL $server) 2>/dev/null & watchdog=$!
    status=0; wait $server || status=$?
    kill $watchdog 2>/dev/null
    ok "serve ends cleanly ($status)" test $status = 0
    exits 1 serve "$here/none.lathe" --port 0
fi

echo "$passed passed, $failed failed"
[ $failed = 0 ]
