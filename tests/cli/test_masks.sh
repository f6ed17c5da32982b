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

# ---- 500 faces on both sides: counted once, and by a divergence sum over the unique faces ----
volume=$(awk 'BEGIN { n = 0 } /^end_header/ { body = 1; next } /^element vertex/ { nv = $3 } !body { next }
    n < nv { x[n] = $1; y[n] = $2; z[n] = $3; n++; next }
    { a = $2; b = $3; c = $4; lo = a < b ? a : b; lo = lo < c ? lo : c
      hi = a > b ? a : b; hi = hi > c ? hi : c; key = lo " " a + b + c - lo - hi " " hi
      if (key in seen) next
      seen[key] = 1
      v += x[a] * (y[b] * z[c] - y[c] * z[b]) + y[a] * (z[b] * x[c] - z[c] * x[b]) \
         + z[a] * (x[b] * y[c] - x[c] * y[b]) }
    END { printf "%.6f", v / 6 }' "$cases/dup_reversed.ply")
expect 0 "500 duplicate faces dropped" groom "$cases/dup_reversed.ply" -o doubled --no-remesh
awk -F '[:,]' -v is="$volume" '/"volume"/ { found = 1; if ($2 / is > 1.0001 || $2 / is < .9999) exit 1 }
    END { if (!found) exit 1 }' doubled/manifest.json || fail "doubled faces: volume is not $volume"

# ---- a vertex far away: one line, soon ----
expect 1 "stray vertex near 1000" check "$cases/one_1000.vtk"
[ "$(wc -l <said)" -le 2 ] || fail "one far vertex: $(cat said)"

exit $failed
