#!/bin/bash
# Joints with planted pose and shape (make_synthetic joint): what was put in comes out, in its own modes.
# $1 is the program, $2 make_synthetic.
. "$(dirname "$0")/head.sh"
fast="--parts a=_a,b=_b --align-parts a -J 40 --faces 1500 --stage1-epochs 4 --stage2-epochs 2 --quiet"

# Sum of the squares of the scores in a table: the variance, up to a factor.
power() { awk -F, 'NR > 1 { for (k = 2; k <= NF; k++) s += $k * $k } END { print s + 0 }' "$1"; }
# The square of the correlation of column 2 of a table of scores with column C of truth.csv.
explained() { paste -d, "$1" "$2/truth.csv" | awk -F, -v c="$3" 'NR > 1 { n++; x = $2; y = $(NF - 2 + c - 1)
    sx += x; sy += y; xx += x * x; yy += y * y; xy += x * y }
    END { print (xy - sx * sy / n) ^ 2 / ((xx - sx * sx / n) * (yy - sy * sy / n)) }'; }
# The largest error in degrees of the turns of part b from the first subject on.
worst_turn() { awk -F, 'NR == FNR { if (FNR > 1) angle[$1] = $2; next }
    FNR == 1 { for (k = 1; k <= NF; k++) if ($k == "b_rx") c = k; next }
    { x = $c; y = $(c + 1); z = $(c + 2) }
    FNR == 2 { x0 = x; y0 = y; z0 = z; a0 = angle[$1] }
    { t = sqrt((x - x0) ^ 2 + (y - y0) ^ 2 + (z - z0) ^ 2); e = t - (angle[$1] - a0); if (e < 0) e = -e; if (e > m) m = e }
    END { print m }' "$1/truth.csv" "$2/poses.csv"; }
holds() { awk "BEGIN { exit !($1) }" || fail "$2"; }

# A turn alone, by 15 degrees to either side: below 1 % of the variance is shape, and the angles are known.
"$synthetic" joint turns count 8 angle 15 seed 4 || exit 1
"$apsm" run turns/shapes -o t $fast >said 2>&1 || fail "turns: $(tail -n 2 said)"
shape=$(power t/shape_scores.csv) pose=$(power t/pose_scores.csv)
holds "$shape < 0.01 * ($shape + $pose)" "a turn leaves $shape in shape, $pose in pose"
holds "$(worst_turn turns t) < 0.7" "the turns are off by up to $(worst_turn turns t) degrees"
holds "$(explained t/pose_scores.csv turns 2) > 0.998" "the first mode of pose explains $(explained t/pose_scores.csv turns 2) of the turn"

# Both: each is the first mode of its own kind.
"$synthetic" joint both count 9 angle 12 form 0.12 seed 5 || exit 1
cp both/shapes/s00_a.ply both/shapes/s99_a.ply # a subject without a part, which has landmarks all the same
sed -n 's/^s00_a/s99_a/p' both/landmarks.csv >>both/landmarks.csv
"$apsm" run both/shapes -o m $fast --landmarks both/landmarks.csv >said 2>&1 || fail "both: $(tail -n 2 said)"
grep -q 's99: has no b' said || fail "nothing said of the missing part: $(cat said)"
holds "$(explained m/pose_scores.csv both 2) > 0.99" "turns with shapes: $(explained m/pose_scores.csv both 2)"
holds "$(explained m/shape_scores.csv both 3) > 0.99" "shapes with turns: $(explained m/shape_scores.csv both 3)"
holds "$(worst_turn both m) < 1" "turns with shapes are off by up to $(worst_turn both m) degrees"
# True landmarks of all parts judge the joint; the subject that is not in it does not count.
tr -d ' \n' <m/evaluation.json >told
grep -q '"landmarks":{"use":"judge"' told && grep -q '"names":\["av0","av1","av2","av3","bv0","bv1","bv2","bv3"\]' told ||
    fail "landmarks of the joint: $(grep -o '"landmarks":.\{300\}' told)"
grep -q '"judged":64,' told || fail "other landmarks than 8 on 8 subjects: $(grep -o '"judged":[0-9]*' told)"
mark=$(sed -n 's/.*"landmarks":{"use":"judge","mean":\([0-9.e-]*\),.*/\1/p' told)
holds "$mark > 0 && $mark < 1" "true landmarks are $mark off"
expect 2 "meshes/mean_PART.ply, and --aligned" landmarks m both/landmarks.csv -o carried
# The two have nothing to do with each other.
holds "$(explained m/shape_scores.csv both 2) < 0.1" "shape follows the turn: $(explained m/shape_scores.csv both 2)"

# Halves that lie next to each other: with the penalty the rebuilt ones go less into each other, beyond what
# the shapes themselves do, and fit no worse.
mkdir halves
for i in 0 1 2 3 4 5 6; do
    "$synthetic" ellipsoid halves/s${i}_lo.ply index $i level 3 open .5 wobble 0.03 seed $i || exit 1
    "$synthetic" ellipsoid halves/s${i}_up.ply index $i level 3 open -.5 wobble 0.03 seed $i lift 0.05 || exit 1
done
excess() { awk -F, '$1 ~ /^s[0-9]/ && $8 > $5 { s += $8 - $5 } END { print s + 0 }' "$1/contacts.csv"; }
distance() { sed -n '/"surface_distance": {/,/"max"/s/.*"mean": \([0-9.e-]*\),.*/\1/p' "$1/evaluation.json" | head -n 1; }
for w in 0 30; do
    "$apsm" run halves -o h$w --parts lo=_lo,up=_up --fill -J 32 --faces 1500 --contact $w --quiet >said 2>&1 || fail "halves: $(tail -n 2 said)"
done
holds "$(excess h0) > 0.05 && $(excess h30) < 0.6 * $(excess h0)" "rebuilt halves: $(excess h30) deep with the penalty, $(excess h0) without"
holds "$(distance h30) < 1.05 * $(distance h0)" "the penalty costs: $(distance h30), $(distance h0)"
exit $failed
