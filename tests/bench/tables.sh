#!/bin/bash
# Runs every program that prints a table of the papers and writes docs/TABLES.md. `make tables` builds them first.
#   tables.sh PROGRAMS-FOLDER OUT.md
set -euo pipefail
programs=$1 out=$2
part=$(mktemp)
trap 'rm -f "$part" "$part.log"' EXIT
{
    echo "# The papers' tables, measured again"
    echo
    echo "Written by \`make tables\`; the papers' own figures stand beside ours. Times are of the machine that ran it: read them as ratios"
    echo "within a table. [M] Min and Lee 2003, [P] Park and Kim 1993, [L] Lyu 1994, [H] Ho, Kim and Kim."
} >"$part"
for name in minlee_table parse_scaling strip_table hierarchy_table; do
    if ! "$programs/$name" >"$part.log"; then
        echo "tables: $name failed; its output:" >&2
        cat "$part.log" >&2
        exit 1
    fi
    { echo; cat "$part.log"; } >>"$part"
    echo "  table $name"
done
cp "$part" "$out"
