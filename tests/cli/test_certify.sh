#!/bin/bash
# The verdict on planted faults from outside: a stranger among shapes that belong, too few shapes to
# judge, and the same verdict on a project as on the model.
set -u
apsm=$1 make_synthetic=$2
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
bad=0
fail() {
    echo "FAIL: $*" >&2
    bad=1
}

for i in 0 1 2 3 4 5; do "$make_synthetic" bump "s$i.ply" level 3 index $i count 6 || exit 1; done
"$make_synthetic" bump x.ply level 3 index 2 count 6 scale 2 || exit 1
few="-J 32 --stage1-epochs 2 --stage2-epochs 2 --set fidelity=0 --threads 1 -q"

# shellcheck disable=SC2086 # options are words
"$apsm" run s?.ply x.ply -o model $few 2>log || fail "run: $(cat log)"
grep -q '^warning: x: .*unlike the others' log || fail "groom does not name the stranger: $(cat log)"
grep -q 'x needs review: its size is unlike' log || fail "the verdict does not name it: $(cat log)"
grep -q '"template": "x"' model/certificate.json && fail "the stranger is the template"
grep -q '"aspect": *"belonging"' model/manifest.json || fail "the manifest does not keep the note"
grep -q '"belonging": *"review"' model/certificate.json || fail "no grade of belonging"

"$apsm" certify model/project.swproj -o cert.json >out 2>log || fail "certify: $(cat log)"
grep -q 'x needs review: its size' log || fail "certify does not name the stranger: $(cat log)"
grep -q '"apsm-certificate"' cert.json || fail "no certificate is written"
"$apsm" certify model/particles/*_world.particles >out 2>log && fail "certify without meshes"
grep -q 'needs a mesh for each shape' log || fail "certify without meshes says: $(cat log)"
"$apsm" certify >out 2>log && fail "certify without operands"

# shellcheck disable=SC2086
"$apsm" run s0.ply s1.ply s2.ply -o three $few 2>log || fail "run of three: $(cat log)"
grep -q '"verdict": *"not judged"' three/certificate.json || fail "three shapes are judged"
grep -q 'fewer than 5 shapes' log || fail "not said that three shapes cannot be judged: $(cat log)"

# Slips are looked for with 12 particles or more; with fewer that is said, and nothing is certified.
# shellcheck disable=SC2086
for J in 11 12; do "$apsm" run s?.ply -o "few$J" ${few/32/$J} 2>"log$J" || fail "run of $J: $(cat "log$J")"; done
grep -q '"slip": *"not looked for"' few11/certificate.json || fail "slips of 11 particles pass"
grep -q '"certified": *0' few11/certificate.json || fail "11 particles are certified"
grep -q 'too few to look for slips' log11 || fail "not said that slips are not looked for: $(cat log11)"
grep -q '"slip": *"pass"' few12/certificate.json || fail "slips of 12 particles do not pass: $(cat log12)"

# Long bones on which psm, unscaled, leaves the ends of all shapes out: certify says so of each.
"$make_synthetic" femur long count 5 seed 0 >/dev/null || exit 1
"$apsm" run long/shapes -o slips --method psm -J 32 --psm-iterations-per-split 60 \
    --psm-optimization-iterations 60 --threads 1 -q 2>log || fail "run of long bones: $(cat log)"
"$apsm" certify slips/project.swproj -o ends.json >out 2>log || fail "certify long bones: $(cat log)"
[ "$(grep -o 'miss a part of the surface' ends.json | wc -l)" -ge 5 ] ||
    fail "missed ends are not seen: $(cat log)"
# A left bone among right ones, and one upside down that nobody turns back: each named, and likely lost
# or of the wrong hand; the others are not.
"$make_synthetic" femur bones count 8 seed 0 >/dev/null || exit 1
mkdir hands poses
cp bones/shapes/*.ply hands
cp bones/shapes/*.ply poses
"$make_synthetic" bones/shapes/femur_02.ply hands/femur_02.ply mirror 1 || exit 1
"$make_synthetic" bones/shapes/femur_03.ply poses/femur_03.ply turn 180 || exit 1
# shellcheck disable=SC2086
"$apsm" run hands -o hand $few 2>log || fail "run with a left bone: $(cat log)"
grep -q '^warning: femur_02 needs review: .*looks mirrored' log || fail "the left bone: $(cat log)"
[ "$(grep -c 'needs review' log)" -eq 1 ] || fail "others are doubted: $(cat log)"
# shellcheck disable=SC2086
"$apsm" run poses -o pose --align none $few 2>log || fail "run with a turned bone: $(cat log)"
grep -q '^warning: femur_03 needs review: .*probability 0\.[6-9]' log || fail "the turned bone: $(cat log)"
[ "$(grep -c 'needs review' log)" -eq 1 ] || fail "others are doubted: $(cat log)"
grep -q '"probability_lost": *0.0' pose/certificate.json || fail "no shape is known to be right"
"$apsm" info pose | grep -q 'expected with over a tenth' || fail "info does not tell what is expected"

# Of an egg among bones, which is named, it is not said once more that it hardly tells how it lies.
mkdir eggs
cp bones/shapes/*.ply eggs
"$make_synthetic" ellipsoid eggs/femur_02.ply level 3 index 1 count 6 scale 3 || exit 1
# shellcheck disable=SC2086
"$apsm" run eggs -o egg $few 2>log || fail "run with an egg: $(cat log)"
grep -q '^warning: femur_02 needs review: .*form is unlike' log || fail "the egg: $(cat log)"
grep -q 'not tell' log && fail "of a shape that is named anyway: $(cat log)"

# If the template's particles change places it is the template that is doubted, not all the others.
t=$(sed -n 's/.*"template_used": *"\([^"]*\)".*/\1/p' hand/project.swproj | head -n 1)
awk '{ line[NR] = $0 } END { for (i = 1; i <= NR; i++) print line[i <= 12 ? 13 - i : i] }' \
    "hand/particles/${t}_world.particles" >moved && cp moved "hand/particles/${t}_world.particles"
"$apsm" certify hand/project.swproj -o moved.json >out 2>log || fail "certify: $(cat log)"
grep -q "$t needs review: .*swapped" log || fail "the template's fault is not seen: $(cat log)"
[ "$(grep -c 'needs review: .*swapped' log)" -eq 1 ] || fail "its fault is laid to others: $(cat log)"

# Ellipsoids look the same turned by half: that is said once, and no shape is doubted for it.
for i in 0 1 2 3 4 5; do "$make_synthetic" ellipsoid "e$i.ply" level 3 index $i count 6 || exit 1; done
# shellcheck disable=SC2086
"$apsm" run e?.ply -o same $few 2>log || fail "run of ellipsoids: $(cat log)"
grep -q 'of 6 shapes the surface does not tell which way' log || fail "ellipsoids: $(cat log)"
grep -q '"pose": *"cannot be told"' same/certificate.json || fail "no grade says that it cannot be told"
grep -q 'looks turned' log && fail "an ellipsoid is doubted: $(cat log)"

echo mine >mine.json
"$apsm" certify model/project.swproj -o mine.json >out 2>log && fail "certify replaced a file"
[ "$(cat mine.json)" = mine ] || fail "certify replaced a file"
exit $bad
