#!/usr/bin/env bash
# Sums up the tests that were skipped, one line each in the given file: those that lack files, by name, and the number of
# those that are left to `make test-long`. Says nothing if there are none.
set -euo pipefail

[ -s "$1" ] || exit 0
later=$(grep -c ' needs make test-long$' "$1" || true)
if [ "$later" != 0 ]; then
    echo "Left to \`make test-long\`: $later tests"
fi
missing=$(grep -v ' needs make test-long$' "$1" | sort -u || true)
[ -n "$missing" ] || exit 0
# A test that asks for several files is counted once.
count=$(awk '{ print $3 }' <<<"$missing" | sort -u | wc -l)
echo "Skipped tests, because files beside the checkout are missing: $count"
echo "$missing"
