#!/bin/bash
# Section 7 of docs/guide.md as it stands there, on a short cohort: a mask of two labels is fitted and judged
# without a word on how masks are read, by the folder and by the model in one file.  $1 is the program.
. "$(dirname "$0")/head.sh"

masks=$here/../../data/hippocampus
mkdir cohort
all=("$masks"/*.nii.gz)
cp "${all[@]:0:10}" cohort/
cp "${all[10]}" new_patient.nii.gz
expect 0 "" run cohort -o hippocampi --label 1,2 -J 32 --faces 600 --stage1-epochs 2 --stage2-epochs 2
{
    echo "name,age,sex"
    for i in 0 1 2 3 4 5 6 7 8 9; do
        name=$(basename "${all[i]}" .nii.gz)
        echo "$name,$((60 + i * 7 % 10)),$([ $((i % 2)) = 0 ] && echo f || echo m)"
    done
    echo "new_patient,65,f"
} >table.csv

commands() { # of the section, the first file's name as here
    sed -n '/^## 7\./,/^## 8\./s/^    apsm \(fit\|norm\) /\1 /p' "$here/../../docs/guide.md"
}
[ "$(commands | wc -l)" -ge 2 ] || fail "section 7 has no commands"
while read -r line; do
    eval "words=($line)"
    expect 0 "" "${words[@]}"
    [ "${words[0]}" = fit ] && ! grep -qF "labels of segmentations are those of the model's shapes: 1,2" said &&
        fail "labels were taken without a word: $(cat said)"
done < <(commands)
[ -s hippocampi/statistics/norm.csv ] || fail "no norm"
grep -q 'id="data"' hippocampi/statistics/norm.html || fail "no page of the norm"
sed -n '/"values"/,$p' hippocampi/statistics/norm.json | grep -q '"name": "centroid size"' ||
    fail "no norm of the size"

# A column of numbers without a formula: z = (x - mean) / (sd sqrt(1 + 1 / N)).
awk -F, 'BEGIN { OFS = "," } NR == 1 { print "name,weight" } NR > 1 && $1 != "new_patient" { print $1, NR * NR }
    END { print "new_patient,150" }' table.csv >weights.csv
expect 0 "" norm hippocampi fits --subjects weights.csv -o plain
z=$(tr -d '\n ' <plain/norm.json | sed 's/.*"name":"weight"[^}]*"z":\([-0-9.e]*\).*/\1/')
awk -F, -v z="$z" 'NR > 1 && $1 != "new_patient" { s += $2; q += $2 * $2; n++ }
    END { m = s / n; sd = sqrt((q - n * m * m) / (n - 1)); w = (150 - m) / (sd * sqrt(1 + 1 / n))
          exit !(z != "" && w > 2 && (z - w) ^ 2 < 1e-12) }' weights.csv || fail "z of a column is $z"

expect 0 "" export hippocampi --model one.apsm
expect 0 "model's shapes: 1,2" fit one.apsm new_patient.nii.gz -o moved
cmp -s fits/particles/new_patient_world.particles moved/particles/new_patient_world.particles ||
    fail "the model in one file reads masks otherwise"
grep -q '"unit": "mm"' moved/fit.json || fail "the unit is not known"
expect 1 "times as large as the mean" fit hippocampi new_patient.nii.gz --label 1 -o front # half of it
exit $failed
