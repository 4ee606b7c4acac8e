#!/usr/bin/env bash
# Sums up the tests that were skipped because files are missing, one line each in the given file. Says nothing if there are none.
set -euo pipefail

[ -s "$1" ] || exit 0
# A test that asks for several files is counted once.
count=$(awk '{ print $3 }' "$1" | sort -u | wc -l)
echo "Skipped tests, because files beside the checkout are missing: $count"
sort -u "$1"
