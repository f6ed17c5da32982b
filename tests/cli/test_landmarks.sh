#!/bin/bash
# Landmarks: they judge what they had no part in, align, and draw the correspondence to them.
# $1 is the program, $2 make_synthetic.
. "$(dirname "$0")/head.sh"
limit=120
quick=(-J 32 --faces 900 --stage1-epochs 2 --stage2-epochs 2 --fidelity-rounds 6 --specificity-samples 10
    --other-templates 0 --threads 2 --template slide_00)

mean() { # mean FOLDER: of the landmarks, in thousandths
    sed -n '/"landmarks": {/,/"judged"/s/.*"mean": \([0-9.e-]*\),.*/\1/p' "$1/evaluation.json" |
        awk '{ printf "%d", 1000 * $1 }'
}

# A knob that sits elsewhere on every shape and drags its skin along: only landmarks tell how far.
"$synthetic" slide s count 5 landmarks 6 seed 3 mirror 4 >/dev/null || exit 1
grep -v "slide_02,L3\|slide_00,L6" s/landmarks.csv >marks.csv
run=(run s/shapes --reflect-match _L --landmarks marks.csv)
expect 0 "6 landmarks, 4 of them on all 5 shapes" "${run[@]}" -o judge "${quick[@]}"
grep -q "landmark 'L3' is missing on 1 of 5 shapes: slide_02" said || fail "what is missing is not said"
grep -q '"use": "judge"' judge/evaluation.json || fail "not a judge"
head -n 1 judge/evaluation.csv | grep -q 'verdict,landmark_mean$' || fail "no column landmark_mean"
expect 0 "" run s/shapes --reflect-match _L -o without "${quick[@]}"
for name in slide_00 slide_03_L; do
    cmp -s {judge,without}/particles/${name}_world.particles || fail "a judge changed $name"
done
expect 0 "agree" verify judge
expect 0 "no independent judge" "${run[@]}" -o anchor --landmarks-use anchor "${quick[@]}"
expect 0 "" "${run[@]}" -o hold --landmarks-use hold "${quick[@]}"
expect 0 "" "${run[@]}" -o align --align-by both "${quick[@]}"
grep -q '"use": "align"' align/evaluation.json || fail "use of align"
[ "$(mean judge)" -gt 500 ] || fail "nothing to win: $(mean judge)"
for use in anchor hold; do
    [ $((5 * $(mean $use))) -lt "$(mean judge)" ] || fail "$use: $(mean $use), judge $(mean judge)"
done
[ "$(mean align)" -lt "$(mean judge)" ] || fail "align: $(mean align), judge $(mean judge)"
if command -v python3 >/dev/null; then
    python3 "$here/landmark_judge.py" judge marks.csv || failed=1
    python3 "$here/landmark_judge.py" anchor marks.csv || failed=1
else
    echo "SKIPPED: no python3, so the distances were not computed anew"
fi
# A step alone, and a resumed run, know them too.
expect 0 "" optimize anchor
expect 0 "" evaluate anchor
[ $((5 * $(mean anchor))) -lt "$(mean judge)" ] || fail "optimize alone forgot the anchors"

# Points placed once: what is carried to the shapes and given back as their landmarks has no error.
grep "^slide_00,\|^shape" marks.csv | cut -d, -f2- >one.csv
expect 0 "" landmarks judge one.csv -o carried
expect 1 "is not empty" landmarks judge one.csv -o carried
expect 0 "" groom s/shapes --reflect-match _L --landmarks carried -o again --faces 500
cmp -s <(grep "^slide_00,L1" carried/landmarks.csv | cut -d, -f1,2) <(echo slide_00,L1) || fail "carried/landmarks.csv"
[ -e carried/slide_03_L.mrk.json ] && [ -e carried/mode_01_plus2sd.mrk.json ] || fail "$(ls carried)"
if command -v python3 >/dev/null; then
    cp carried/landmarks.csv judge2.csv
    expect 0 "" run s/shapes --reflect-match _L --landmarks judge2.csv -o same "${quick[@]}"
    [ "$(mean same)" -le 1 ] || fail "landmarks that were carried miss by $(mean same)"
fi
expect 2 "needs" landmarks judge one.csv
expect 1 "nothere" landmarks judge nothere.csv -o carried2
printf 'name,x,y,z\na,1e9,0,0\n' >far.csv
expect 1 "'a' lies 1e+09 from the nearest particle" landmarks judge far.csv -o carried2
expect 1 "give it in the frame of its input" landmarks judge far.csv -o carried2
printf 'name,x,y,z\na,1e300,0,0\n' >far.csv
expect 1 "'a' is not at a place" landmarks judge far.csv -o carried2
printf 'name,x,y,z\na,1,5,2,5,3,5\n' >far.csv # commas of decimals
expect 1 "far.csv:2: is not name,x,y,z" landmarks judge far.csv -o carried2
[ -e carried2 ] && fail "a folder is left where landmarks cannot be carried"
sed 's/^slide_00,L1,[^,]*/slide_00,L1,1e6/' s/landmarks.csv >far.csv
expect 0 "1 landmark lies farther from the shape than it is long ('L1' is 1e+06 away from slide_00)" groom s/shapes -o far --landmarks far.csv --faces 500
sed 's/^slide_00,L1,[^,]*/slide_00,L1,1e20/' s/landmarks.csv >far.csv
expect 1 "far.csv:2: 'L1' is not at a place" groom s/shapes -o nowhere --landmarks far.csv --faces 500
[ -e nowhere ] && fail "landmarks that are nowhere leave a folder"
[ -e carried2 ] && fail "a refused call left a folder"

# A project's landmarks, in ShapeWorks' way: points without names.
mkdir lm
for i in 0 1 2; do
    grep "^slide_0$i,L[12345]" s/landmarks.csv | cut -d, -f3-5 | tr , ' ' >lm/$i.txt
    printf '%s{"name": "slide_0%d", "shape_1": "s/shapes/slide_0%d.ply", "landmarks_file_1": "lm/%d.txt"}' \
        "${rows:+, }" $i $i $i >>rows
    rows=1
done
printf '{"data": [%s], "landmarks": [{"domain": "1", "name": "tip"}]}' "$(cat rows)" >p.swproj
expect 0 "5 landmarks, 5 of them" groom p.swproj -o p --faces 500
grep -q "^slide_01,tip," p/landmarks.csv || fail "the project's names: $(head -n 2 p/landmarks.csv)"
printf '{"data": [%s], "optimize": {"use_landmarks": "true"}}' "$(cat rows)" >q.swproj
expect 0 "no independent judge" run q.swproj -o q "${quick[@]}"
grep -q '"use": "anchor"' q/evaluation.json || fail "use_landmarks is not used"
rm lm/1.txt
expect 0 "1 landmark files that the project names are not there" groom p.swproj -o p --faces 500 --overwrite
expect 1 "lm/1.txt" groom q.swproj -o r
[ -e r ] && fail "a refused run left a folder"

# ---- what is wrong ----
expect 2 "and there are none" groom s/shapes -o r --landmarks-use anchor
expect 2 "holds no landmarks of these shapes" groom s/shapes -o r --landmarks lm
printf 'name,x,y,z\na,1,2,3\n' >one.csv
expect 1 "begin with the line shape,name,x,y,z" groom s/shapes -o r --landmarks one.csv
expect 1 "nothere.csv" groom s/shapes -o r --landmarks nothere.csv
[ -e r ] && fail "a refused run left a folder"
exit $failed
