#!/bin/bash
# Runs every test and adds up. Each program prints "N passed, N failed" as its last line (node's runner: "# pass N"); one that
# prints no count stands for one test, passed when it exits with 0. Output of all is kept in build/test/.
#   run_tests.sh            everything          run_tests.sh sanitize|fuzz     only that
set -u
cd "$(dirname "$0")/../.." || exit 1
part=${1:-all}
jobs=${JOBS:-$(nproc 2>/dev/null || echo 2)}
logs=build/test
mkdir -p $logs
passed=0 failed=0
export LATHE_BIN=$PWD/build/lathe
export LATHE_BUILD=$PWD/build/release
export LATHE_PHANTOM=$PWD/build/release/tests/make_phantom

count() {                                   # NAME EXIT-STATUS LOG: adds the counts of one program
    local name=$1 status=$2 log=$3 p f
    p=$(sed -n 's/^\(# pass\|ℹ pass\) \([0-9]*\)$/\2/p' "$log" | tail -n 1)
    f=$(sed -n 's/^\(# fail\|ℹ fail\) \([0-9]*\)$/\2/p' "$log" | tail -n 1)
    if [ -z "$p" ]; then
        p=$(sed -n 's/^\([0-9]*\) passed, \([0-9]*\) failed.*$/\1/p' "$log" | tail -n 1)
        f=$(sed -n 's/^\([0-9]*\) passed, \([0-9]*\) failed.*$/\2/p' "$log" | tail -n 1)
    fi
    if [ -z "$p" ]; then p=$((status == 0)) f=0; fi
    # A crash after the count is a failure too.
    if [ "$status" != 0 ] && [ "${f:-0}" = 0 ]; then f=1; fi
    passed=$((passed + p)) failed=$((failed + ${f:-0}))
    if [ "${f:-0}" = 0 ]; then
        printf '  ok    %-34s %6d passed\n' "$name" "$p"
    else
        printf '  FAIL  %-34s %6d passed, %d failed (exit %d), log %s\n' "$name" "$p" "$f" "$status" "$log"
        grep -vE '^[0-9]+ passed, [0-9]+ failed' "$log" | tail -n 40 | sed 's/^/        /'
    fi
}

run() {                                     # NAME SECONDS COMMAND...: runs it now and counts it
    local name=$1 limit=$2 status=0
    shift 2
    timeout -k 10 "$limit" "$@" >"$logs/$name.log" 2>&1 </dev/null || status=$?
    [ $status = 124 ] && echo "timed out after $limit s" >>"$logs/$name.log"
    count "$name" $status "$logs/$name.log"
}

run_many() {                                # SUFFIX SECONDS PROGRAM...: side by side, counted in order
    local suffix=$1 limit=$2 program name
    shift 2
    printf '%s\n' "$@" | xargs -P "$jobs" -I{} bash -c '
        log=$0/$(basename {})$1.log; status=0
        timeout -k 10 "$2" {} >"$log" 2>&1 </dev/null || status=$?
        [ $status = 124 ] && echo "timed out after $2 s" >>"$log"
        echo $status >"$log.status"' "$PWD/$logs" "$suffix" "$limit"
    for program in "$@"; do
        name=$(basename "$program")$suffix
        count "$name" "$(cat "$logs/$name.log.status")" "$logs/$name.log"
    done
}

build() {                                   # LOG make-arguments...: a build that fails is a failed test, and the rest goes on
    local log=$1 status=0
    shift
    make --no-print-directory -k -j "$jobs" "$@" >"$logs/$log.log" 2>&1 || status=$?
    count "$log" $status "$logs/$log.log"
}

programs() {                                # CONFIG: the unit tests that were built
    local source program
    for source in tests/test_*.c; do
        program=build/$1/tests/$(basename "$source" .c)
        if [ -x "$program" ]; then echo "$program"; fi
    done
}

tests_native() {
    build build-release config=release all test-programs
    local list
    list=$(programs release)
    # shellcheck disable=SC2086
    [ -n "$list" ] && run_many "" 300 $list
    local script
    for script in tests/test_*.sh; do [ -f "$script" ] && run "$(basename "$script")" 400 bash "$script"; done
    for script in tests/test_*.mjs tests/*_test.mjs tests/*.test.mjs; do
        [ -f "$script" ] && run "$(basename "$script")" 400 node --test --test-reporter=tap "$script"
    done
    for script in web/test/*.test.mjs web/test/test_*.mjs; do
        [ -f "$script" ] && run "web-$(basename "$script")" 400 node --test --test-reporter=tap "$script"
    done
}

tests_sanitize() {
    build build-sanitize config=sanitize sanitize-programs
    export ASAN_OPTIONS=detect_leaks=1:allocator_may_return_null=1 UBSAN_OPTIONS=print_stacktrace=1
    local list
    list=$(programs sanitize)
    # shellcheck disable=SC2086
    [ -n "$list" ] && run_many "-sanitize" 600 $list
    if [ -x build/sanitize/lathe ] && [ -f tests/test_cli.sh ]; then
        LATHE_BIN=$PWD/build/sanitize/lathe LATHE_PHANTOM=$PWD/build/sanitize/tests/make_phantom run test_cli.sh-sanitize 600 bash tests/test_cli.sh
    fi
}

seed_archives() {                           # small archives, and their streams behind the byte that fuzz_delta takes first
    local kind
    mkdir -p build/corpus/fuzz_archive build/corpus/fuzz_delta
    [ -x "$LATHE_BIN" ] && [ -x "$LATHE_PHANTOM" ] || return
    for kind in ball labels values keep; do
        "$LATHE_PHANTOM" ${kind/keep/values} build/corpus/$kind.json 14
        local options="--iso 100"
        [ $kind = labels ] && options="--labels all"
        [ $kind = keep ] && options="--iso 100 --topology keep"
        # shellcheck disable=SC2086
        "$LATHE_BIN" bake build/corpus/$kind.json $options --quiet -o build/corpus/fuzz_archive/$kind
        seed_stream $kind
    done
    for kind in radius tubes plain_hole plain_parts; do
        cp tests/golden/$kind.lathe build/corpus/fuzz_archive/$kind
        seed_stream $kind
    done
}
seed_stream() {                             # of an archive: what is before its footer
    local from=build/corpus/fuzz_archive/$1 size footer
    size=$(stat -c %s "$from")
    footer=$(od -An -tu8 -j $((size - 16)) -N 8 "$from" | tr -d ' ')
    { printf '\0'; head -c "$footer" "$from"; } >build/corpus/fuzz_delta/"$1"
}

tests_fuzz() {
    local source name seconds=${SECONDS_EACH:-10}
    build build-fuzz config=fuzz fuzzers
    seed_archives
    for source in tests/fuzz_*.c; do
        name=$(basename "$source" .c)
        [ -x "build/fuzz/tests/$name" ] || continue
        mkdir -p "build/corpus/$name"
        local seeds=()
        [ -d "tests/corpus/$name" ] && seeds=("tests/corpus/$name")
        run "$name" $((seconds + 120)) "build/fuzz/tests/$name" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 \
            -artifact_prefix="$logs/$name-" -print_final_stats=1 "build/corpus/$name" "${seeds[@]}"
    done
}

case $part in
all) tests_native; tests_sanitize; tests_fuzz ;;
sanitize) tests_sanitize ;;
fuzz) tests_fuzz ;;
*) echo "usage: run_tests.sh [sanitize|fuzz]" >&2; exit 2 ;;
esac

echo "$passed passed, $failed failed"
[ $failed = 0 ]
