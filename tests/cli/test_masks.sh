#!/bin/bash
# What grooming makes of masks, by the numbers in manifest.json.  $1 is the program, $2
# make_synthetic, and tests/data/cases is found beside this file.
. "$(dirname "$0")/head.sh"
cases=$here/../data/cases

# ---- whole bones on thick slices end flat, but were not cut off ----
expect 0 "10 shapes groomed" groom "$cases/talus5" -o whole --faces 5000
grep -q "cropped" said && fail "whole tali were cropped: $(cat said)"
[ "$(grep -cE '"cropped": 0\.0[,}]?$' whole/manifest.json)" = 10 ] || fail "cropped: not 0 ten times"
expect 0 "no end looks cut off" groom "$cases"/talus5/a[239].nii.gz -o uncut --faces 5000 --cuts crop
# One without its highest slice of the bone: 79 x 91 x 11 voxels of a byte behind 352 of header, 11 written where the header has it.
gunzip -c "$cases/talus5/a2.nii.gz" | head -c $((352 + 79 * 91 * 11)) >a2.nii
printf '\013\000' | dd of=a2.nii bs=1 seek=46 conv=notrunc 2>/dev/null
expect 0 "are cropped there" groom a2.nii "$cases"/talus5/a[39].nii.gz -o forced --faces 5000 --cuts crop
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

# ---- a branched sinus: all shapes are closed, the model says so, and an interruption changes nothing ----
"$2" sinus sinus count 4 x 2.4 y 2.4 z 2.4 tunnels 30 >/dev/null || exit 1
expect 0 "a branched sinus" groom sinus/shapes -o closed --faces 1000
grep -q '"closing": "0.1' closed/project.swproj || fail "sinus: new shapes would be groomed otherwise"
[ "$(grep -c '"handles_before": 0' closed/manifest.json)" = 0 ] || fail "sinus: its handles are forgotten"
[ "$(grep -c '"text": "handles or gaps narrower' closed/manifest.json)" = 4 ] || fail "sinus: not four notes"
for _ in mended closed; do expect 0 "" groom sinus/shapes -o again --faces 1000 --shard 1/1; done
expect 0 "4 of 4 shapes were groomed before" groom sinus/shapes -o again --faces 1000
diff -r closed/groomed again/groomed >/dev/null || fail "sinus: gone on with, it comes out otherwise"
expect 0 "" groom sinus/shapes -o asked --faces 1000 --closing 0.1
diff -r closed/groomed asked/groomed >/dev/null || fail "sinus: --closing 0.1 is another closing"
expect 1 "the opening leaves nothing" groom sinus/shapes -o none --opening 99mm
[ -e none ] && fail "--opening 99mm leaves a half folder"

# ---- a hole that most have is anatomy: also where it is narrow, and a quiet run does not end with the opposite ----
mkdir rings
for half in 4 5 3 1; do
    { printf 'NRRD0004\ntype: uchar\ndimension: 3\nsizes: 24 24 12\nspacings: 1 1 1\nencoding: ascii\n\n'
        awk -v h=$half 'BEGIN { for (k = 0; k < 12; k++) for (j = 0; j < 24; j++) for (i = 0; i < 24; i++) {
            inside = i > 1 && i < 22 && j > 1 && j < 22 - h && k > 1 && k < 10
            hole = i >= 12 - h && i < 12 + h && j >= 12 - h && j < 12
            print inside && !hole } }'; } >rings/r$half.nrrd
done
expect 0 "r1.nrrd: 1 handle: " groom rings -o ring --faces 1000 -q
grep -q 'the 1 where it was narrow and mended, as said above, get it back' said || fail "rings: $(cat said)"
[ "$(grep -c '"genus": 1' ring/manifest.json)" = 4 ] || fail "rings: not four with their hole"

exit $failed
