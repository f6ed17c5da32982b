#!/bin/bash
# A joint of two balls-and-sockets of known pose: two parts a subject, one of them mirrored in half of the
# subjects, one subject without a part.  $1 is the program, $2 make_synthetic.
. "$(dirname "$0")/head.sh"
run() { "$apsm" run --quiet "$@" >said 2>&1 || fail "run $*: $(tail -n 2 said)"; }
refuse() { # CODE WORDS ARGUMENT...
    local code=$1 words=$2 said
    shift 2
    said=$("$apsm" run --quiet "$@" 2>&1)
    local got=$?
    [ $got -eq "$code" ] || fail "run $*: exit code $got, not $code: $said"
    grep -qF -- "$words" <<<"$said" || fail "run $*: does not say '$words': $said"
}
# Column C of row NAME of a CSV.
cell() { awk -F, -v name="$2" -v column="$3" 'NR == 1 { for (k = 1; k <= NF; k++) if ($k == column) c = k }
    $1 == name { print $c }' "$1"; }

# Every subject has a cup of its own form, and the same ball, turned by 6 degrees more from one to the
# next about an axis through the origin, then moved away.  Subjects m* are mirror images as a whole.
mkdir shapes
for i in 0 1 2 3 4 5; do
    side=s
    [ $((i % 2)) -eq 1 ] && side=m
    "$synthetic" ellipsoid cup.ply level 3 index $i count 6 wobble 0.03 seed 3 || exit 1
    "$synthetic" ellipsoid ball.ply level 3 index 2 count 6 wobble 0.03 seed 8 \
        turn $((6 * i - 15)) shift 60 || exit 1
    mirror=$((i % 2))
    "$synthetic" cup.ply shapes/${side}${i}_cup.ply mirror $mirror || exit 1
    "$synthetic" ball.ply shapes/${side}${i}_ball.ply mirror $mirror || exit 1
done
cp shapes/s0_ball.ply shapes/s9_ball.ply # a subject without a cup
fast="-J 32 --faces 1200 --stage1-epochs 4 --stage2-epochs 2"
parts="--parts cup=_cup,ball=_ball --align-parts cup --reflect-match ^m"

"$apsm" run shapes -o joint $parts $fast >said 2>&1 || fail "joint: $(tail -n 2 said)"
grep -q 's9: has no cup' said || fail "nothing said of the subject without a cup"
for file in model.json scores.csv poses.csv pose_shape.json contacts.csv evaluation.json \
    certificate.json project.swproj manifest.json report.html meshes/mean_cup.ply \
    meshes/pose_mode_01_plus2sd_ball.ply particles/m1_ball_world.particles \
    parts/cup/report.html parts/ball/model.json; do
    [ -s "joint/$file" ] || fail "no $file"
done
# What the report's page reads is there as for a single part.
for key in specificity_samples generalization_standard_error surface_distance; do
    grep -q "\"$key\"" joint/evaluation.json || fail "evaluation.json has no $key"
done
for key in thresholds mismatched_1.5_2.0 off_surface_max closed_joint_spaces; do
    grep -q "\"$key\"" joint/certificate.json || fail "certificate.json has no $key"
done
tr -d '\n' <joint/certificate.json | grep -q '"the same file as s0_ball[^}]*"part": "ball"' ||
    fail "the joint's certificate does not hold its parts' notes"
[ "$(wc -l <joint/poses.csv)" -eq 7 ] || fail "poses.csv: not 6 subjects"

# The planted angles: from one subject to the next the ball turns by 6 degrees, the cup stays.
for i in 0 1 2 3 4; do
    a=s$i b=m$((i + 1))
    [ $((i % 2)) -eq 1 ] && a=m$i b=s$((i + 1))
    for part in cup ball; do
        turn=$(for axis in rx ry rz; do
            echo "$(cell joint/poses.csv $a ${part}_$axis) $(cell joint/poses.csv $b ${part}_$axis)"
        done | awk '{ d += ($1 - $2) ^ 2 } END { print sqrt(d) }')
        [ $part = cup ] && want=0 || want=6
        awk -v t="$turn" -v w=$want 'BEGIN { exit !((t - w) ^ 2 < 1) }' ||
            fail "the $part turns by $turn degrees from $a to $b, not $want"
    done
done

# Spaces of subjects, of the mean and of modes of all, of poses, of shapes are measured, and counted.
for name in 'mean of the cohort' 'mode 1 -2sd' 'pose mode 1 +2sd' 'shape mode 1 -2sd'; do
    grep -q "^$name,cup,ball," joint/contacts.csv || fail "contacts.csv has no $name"
done
grep -q '"rebuilt": 6,' joint/certificate.json || fail "spaces are not counted"
"$apsm" info joint >said 2>&1
grep -q 'joint spaces that close: 0 of 6 rebuilt ones, [0-9]* of [0-9]* of the mean and modes, [0-9]* of [0-9]* where poses' said || fail "info says nothing of spaces: $(tail -n 3 said)"
grep -q 'do not belong' said && fail "info doubts a joint: $(cat said)"

# Turning is no shape: the ball, which is always the same, hardly varies; the cup does.
most() { awk -F, 'NR > 1 { x = $2 < 0 ? -$2 : $2; if (x > m) m = x } END { print m + 0 }' "$1"; }
awk -v b="$(most joint/parts/ball/scores.csv)" -v c="$(most joint/parts/cup/scores.csv)" \
    'BEGIN { exit !(c > 0 && b < 0.1 * c) }' || fail "the ball varies as if it were not always the same"

# The same bytes with two threads, and after an interruption.
"$apsm" run shapes -o again $parts $fast --threads 2 --quiet 2>/dev/null || fail "second run"
for file in model.json scores.csv poses.csv pose_shape.json contacts.csv certificate.json; do
    cmp -s joint/$file again/$file || fail "$file differs with two threads"
done
rm again/model.json again/parts/ball/report.html
"$apsm" run --resume shapes -o again $parts $fast --quiet >said 2>&1 || fail "resume: $(tail -n 1 said)"
cmp -s joint/model.json again/model.json || fail "resumed: another model"

# It can be verified as a whole, parts included, and is not mistaken for a model of one part.
"$apsm" verify joint >said 2>&1 || fail "verify: $(tail -n 3 said)"
agree=$(tail -n 1 said)
"$apsm" report joint >said 2>&1 || fail "report: $(tail -n 3 said)"
"$apsm" verify joint >said 2>&1 || fail "verify after report: $(tail -n 3 said)"
[ "$(tail -n 1 said)" = "$agree" ] || fail "report strikes files off the manifest: $(tail -n 1 said)"
echo >>joint/parts/cup/scores.csv
"$apsm" verify joint >said 2>&1 && fail "a changed file of a part is not found"
said=$("$apsm" evaluate joint 2>&1) && fail "evaluate of a joint"
grep -q 'holds a joint of several parts' <<<"$said" || fail "evaluate says: $said"

# New subjects: a new cup with the ball where it should be, mirrored as a whole, and one without a ball.
mkdir new alone
"$synthetic" ellipsoid cup.ply level 3 index 7 count 6 wobble 0.03 seed 3 || exit 1
"$synthetic" ellipsoid ball.ply level 3 index 2 count 6 wobble 0.03 seed 8 turn 4 shift 60 || exit 1
cp cup.ply new/n1_cup.ply && cp ball.ply new/n1_ball.ply
"$synthetic" cup.ply new/n2_cup.ply mirror 1 && "$synthetic" ball.ply new/n2_ball.ply mirror 1
cp cup.ply alone/n1_cup.ply
cp -r joint fitted && sed -i '$d' fitted/parts/cup/scores.csv # the line that was added above
for t in 1 2; do
    "$apsm" fit fitted new -o f$t --threads $t --quiet >said 2>&1 || fail "fit of joints: $(tail -n 2 said)"
done
diff -r f1 f2 >/dev/null || fail "threads change fits of joints"
[ "$(cell f1/joint_fit.csv n1 mirrored)$(cell f1/joint_fit.csv n2 mirrored)" = noyes ] ||
    fail "hands of new joints: $(cut -d, -f1-4 f1/joint_fit.csv)"
awk -v a="$(cell f1/joint_fit.csv n1 mahalanobis)" -v b="$(cell f1/joint_fit.csv n2 mahalanobis)" \
    'BEGIN { exit !(a > 0 && (a - b) ^ 2 < 0.04) }' || fail "the mirror image fits otherwise: $(cut -d, -f1-8 f1/joint_fit.csv)"
centre() { awk '{ for (k = 1; k <= 3; k++) c[k] += $k } END { print c[1] / NR, c[2] / NR, c[3] / NR }' "$1"; }
for part in cup ball; do # in the frames of the inputs, where n2 is the mirror image of n1
    echo "$(centre f1/particles/n1_${part}_original.particles) $(centre f1/particles/n2_${part}_original.particles)" |
        awk '{ exit !(($1 + $4)^2 + ($2 - $5)^2 + ($3 - $6)^2 < 1) }' || fail "the mirrored $part does not lie where its input is"
done
"$apsm" fit fitted alone -o f3 --quiet >said 2>&1 || fail "fit of one part: $(tail -n 2 said)"
grep -q '"verdict": "missing"' f3/joint_fit.json || fail "nothing said of the missing ball"
[ "$(wc -l <f3/particles/n1_ball_original.particles)" -eq 32 ] || fail "the missing ball is not completed"
off=$(paste f1/particles/n1_ball_original.particles f3/particles/n1_ball_original.particles |
    awk '{ d += sqrt(($1 - $4)^2 + ($2 - $5)^2 + ($3 - $6)^2); n++ } END { print d / n }')
awk -v d="$off" 'BEGIN { exit !(d < 30) }' || fail "the completed ball is $off away" # the cohort's swing by 50
"$apsm" fit fitted new -o f1 --quiet >said 2>&1 && fail "fits were replaced"
"$apsm" fit fitted new -o fitted --quiet >said 2>&1 && fail "fits went into a model"
said=$("$apsm" fit fitted new -o f4 --aligned 2>&1) && fail "--aligned was dropped"
grep -q -- '--aligned: the parts' <<<"$said" || fail "aligned joints: $said"
said=$("$apsm" fit fitted new -o f4 --parts cup=1,ball=2 --label 3 2>&1) && fail "--label was dropped"
grep -q 'the parts are labels' <<<"$said" || fail "labels twice: $said"
[ -e f4 ] && fail "a refused fit made a folder"
said=$("$apsm" fit fitted new -o f4 --parts cop=_cup,ball=_ball 2>&1) && fail "a part that is none"
grep -q "has no part 'cop'" <<<"$said" || fail "wrong part: $said"

# A model of all parts is a model: rendered like one.
"$apsm" render joint -o pictures --quiet >said 2>&1 || fail "render: $(tail -n 1 said)"
[ -s pictures/modes.png ] || fail "no picture of the joint"

# The same joint from a project with two domains: the same bytes, its columns kept in the parts.
{
    printf '{"data": ['
    comma=
    for side in m1 m3 m5 s0 s2 s4; do
        printf '%s{"name": "%s", "shape_cup": "shapes/%s_cup.ply", "shape_ball": "shapes/%s_ball.ply", "group_side": "%s", "landmarks_file_ball": "marks/%s.csv"}' \
            "$comma" $side $side $side ${side:0:1} $side
        comma=', '
    done
    printf '], "groom": {}, "optimize": {}, "project": {}, "studio": {"notes": "mine"}}'
} >two.swproj
"$apsm" run two.swproj -o project --align-parts cup --reflect-match ^m $fast --quiet 2>said ||
    fail "project of two domains: $(tail -n 1 said)"
"$apsm" run shapes -o six --exclude s9 $parts $fast --quiet 2>said || fail "six: $(tail -n 1 said)"
for file in scores.csv poses.csv contacts.csv; do
    cmp -s six/$file project/$file || fail "$file of the project is another"
done
for words in '"group_side": "m"' '"landmarks_file_ball": "../marks/m1.csv"' '"notes": "mine"'; do
    grep -qF "$words" project/project.swproj || fail "the joint's project has lost $words"
done
grep -q '"group_side": "m"' project/parts/ball/project.swproj || fail "a column of the project is lost"
"$apsm" test project --formula '~ side' --permutations 50 --quiet >said 2>&1 || fail "test by a column of the joint's project: $(tail -n 1 said)"
"$apsm" run two.swproj -o ball --domain ball --reflect-match ^m $fast --quiet 2>said ||
    fail "one domain: $(tail -n 1 said)"
cmp -s ball/scores.csv project/parts/ball/scores.csv || fail "--domain ball is another model"
"$apsm" evaluate ball --quiet 2>said || fail "evaluate of a domain: $(tail -n 1 said)"

# What is wrong is said before the long part.
refuse 2 "write --parts" shapes -o x --parts cup
refuse 2 "has no domain 'foot'" two.swproj -o x --domain foot
rm -rf x
refuse 2 "two parts of one name" shapes -o x --parts a=_cup,A=_ball
refuse 2 "is none of the parts" shapes -o x --parts cup=_cup,horn=_horn
refuse 2 "is both" shapes -o x --parts cup=_cup,any=_
refuse 2 "give global, apart, or the name of a part" shapes -o x --parts cup=_cup,ball=_ball \
    --align-parts horn
refuse 2 "has no labels" shapes -o x --parts cup=1,ball=2
refuse 2 "labels and names" shapes -o x --parts cup=1,ball=_ball
[ -e x ] && fail "a refused job left a folder"
refuse 1 "holds a joint model already" shapes -o joint $parts
mkdir own && echo mine >own/scores.csv
refuse 1 "no joint model of ours" shapes -o own $parts
[ "$(cat own/scores.csv)" = mine ] || fail "a user's file was replaced"
# What works on a model of one part says so of a joint, and changes nothing.
find joint -type f -exec cksum {} + | sort >joint_before
for verb in "add joint shapes" "exclude joint a" "compare joint joint/parts/cup" "export joint --model joint.apsm"; do
    # shellcheck disable=SC2086
    "$apsm" $verb >said 2>&1 && fail "$verb worked"
    grep -Eq "parts a subject|joint of several parts" said || fail "$verb: $(tail -n 1 said)"
done
find joint -type f -exec cksum {} + | sort | cmp -s - joint_before || fail "a refused verb changed the joint"

# A joint for other programs: the surfaces of all parts, and all particles.
"$apsm" export joint --to csv -o tables >said 2>&1 || fail "export of a joint: $(tail -n 1 said)"
particles=$(($(head -n 1 tables/particles.csv | tr ',' '\n' | wc -l) / 3))
[ "$particles" = "$(sed -n 's/.*"particles": \([0-9]*\).*/\1/p' joint/evaluation.json | head -1)" ] ||
    fail "the export of a joint has $particles particles"
exit $failed
