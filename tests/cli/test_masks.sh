#!/bin/bash
# What grooming makes of masks, by the numbers in manifest.json.  $1 is the program, $2
# make_synthetic, and tests/data/cases is found beside this file.
set -u
apsm=$1
cases=$(cd "$(dirname "$0")/../data/cases" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
failed=0

fail() {
    echo "FAILED: $*"
    failed=1
}

# expect CODE WORDS ARGUMENT...: exit code, and words in what the program says (both streams).
expect() {
    local code=$1 words=$2
    shift 2
    timeout 60 "$apsm" "$@" >said 2>&1 </dev/null
    local got=$?
    if [ $got -ne "$code" ]; then
        fail "apsm $*: exit code $got, not $code: $(tail -n 3 said)"
    elif [ -n "$words" ] && ! grep -qF -- "$words" said; then
        fail "apsm $*: does not say '$words': $(tail -n 3 said)"
    fi
}

# ---- whole bones on thick slices end flat, but were not cut off ----
expect 0 "10 shapes groomed" groom "$cases/talus5" -o whole --faces 5000
grep -q "cropped" said && fail "whole tali were cropped: $(cat said)"
[ "$(grep -cE '"cropped": 0\.0[,}]?$' whole/manifest.json)" = 10 ] || fail "cropped: not 0 ten times"
expect 0 "are cropped there" groom "$cases"/talus5/a[239].nii.gz -o forced --faces 5000 --cuts crop
grep -qE '"cropped": 0\.0[,}]?$' forced/manifest.json && fail "--cuts crop: says nothing was cropped"
[ "$(grep -c 'cropped to what all shapes hold' forced/manifest.json)" = 3 ] ||
    fail "--cuts crop: not three notes"

exit $failed
