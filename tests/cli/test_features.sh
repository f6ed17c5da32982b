#!/bin/bash
# Features: fields of the surface that must correspond, and are sampled at the particles.
# $1 is the program, $2 make_synthetic.
. "$(dirname "$0")/head.sh"
limit=120
quick=(-J 48 --faces 900 --align none --stage1-epochs 2 --stage2-epochs 3 --fidelity-rounds 6
    --specificity-samples 10 --other-templates 0 --threads 2 --template e0)

# Equal ellipsoids, on which a warm patch sits elsewhere.
mkdir in bare
for i in 0 1 2 3 4 5; do
    "$synthetic" ellipsoid in/e$i.ply level 3 index 0 patch $((65 + 10 * (i * 5 % 6))) || exit 1
done
"$synthetic" ellipsoid bare/e0.ply level 3 || exit 1
# share of the field's variance that is between shapes at corresponding particles, in thousandths
between() {
    awk -F, 'NR > 1 { n[$2]++; s[$2] += $3; q[$2] += $3 * $3; N++; S += $3; Q += $3 * $3 }
        END { for (j in n) w += q[j] - s[j] * s[j] / n[j]; printf "%d", 1000 * w / (Q - S * S / N) }' "$1/features.csv"
}
variances() { # the first as a share of all, in percent, and all
    tr -d ' \n' <"$1/evaluation.json" | sed 's/.*"variances":\[\([^]]*\)\].*/\1/' |
        awk -F, '{ for (k = 1; k <= NF; k++) s += $k; printf "%d %d", 100 * $1 / s, s }'
}
expect 0 "" run in -o plain --features heat:0 "${quick[@]}"
expect 0 "" run in -o warm --features heat:1 "${quick[@]}"
expect 0 "" run in -o both --features heat,normals:0.3 "${quick[@]}"
expect 0 "" run in -o none "${quick[@]}"
for i in 0 3; do
    cmp -s {plain,none}/particles/e${i}_world.particles || fail "a field that is only sampled moved e$i"
done
read -r first all <<<"$(variances plain)"
[ "$all" -le 1 ] || fail "without the feature equal shapes vary by $all"
read -r first all <<<"$(variances warm)"
[ "$first" -gt 80 ] && [ "$all" -gt 100 ] || fail "with it the first mode has $first % of $all"
[ "$(between plain)" -gt 200 ] || fail "nothing to win: $(between plain)"
for model in warm both; do
    [ "$(between $model)" -lt 20 ] || fail "$model: $(between $model) of the field is between shapes"
done
[ "$(wc -l <warm/features.csv)" -eq $((1 + 6 * 48)) ] || fail "features.csv has $(wc -l <warm/features.csv) lines"
head -c 600 warm/meshes/mean.ply | grep -aq "property float heat" || fail "the mean has no field"
head -c 600 warm/groomed/e1.ply | grep -aq "property float heat" || fail "groomed meshes have no field"
expect 0 "agree" verify warm
expect 0 "" optimize warm
expect 0 "" evaluate warm
[ "$(between warm)" -lt 20 ] || fail "optimize alone forgot the feature: $(between warm)"

# The same field from the other formats; of .vtk both ways that it can stand there.
mkdir other
"$synthetic" ellipsoid other/e0.vtp level 3 index 0 patch 65 || exit 1
for way in SCALARS FIELD; do
    {
        printf '# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0\n9 0 0\n0 9 0\n0 0 9\n'
        printf 'POLYGONS 4 16\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\nPOINT_DATA 4\nNORMALS n float\n1 0 0 1 0 0 1 0 0 1 0 0\n'
        if [ $way = SCALARS ]; then
            printf 'SCALARS heat float 1\nLOOKUP_TABLE default\n0 9 0 0\n'
        else
            printf 'FIELD f 2\nother 2 4 int\n1 2 3 4 5 6 7 8\nheat 1 4 double\n0 9 0 0\n'
        fi
    } >other/$way.vtk
done
expect 0 "" groom other -o formats --features heat:0 --align none --faces 300
for name in e0 SCALARS FIELD; do
    head -c 600 formats/groomed/$name.ply | grep -aq "property float heat" || fail "$name has lost its field"
done
cmp -s formats/groomed/SCALARS.ply formats/groomed/FIELD.ply || fail "a field is read otherwise as SCALARS"

# A finished model takes shapes by their form alone.
cp in/e5.ply late.ply
expect 1 "make the model anew" add warm late.ply
expect 0 "agree" verify warm
expect 0 "" add plain late.ply
cp bare/e0.ply bare.ply
expect 1 "have no field 'heat'" add plain bare.ply
expect 0 "agree" verify plain
grep -q "^late,0," plain/features.csv || fail "the shape that was added has no samples"

# An image that a project names, here the x of a voxel.
{
    printf 'NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 3 2 2\n'
    printf 'space directions: (50,0,0) (0,100,0) (0,0,100)\nspace origin: (-50,-50,-50)\nencoding: ascii\n\n'
    printf -- '-50 0 50 -50 0 50 -50 0 50 -50 0 50\n'
} >x.nrrd
for i in 0 1 2; do
    printf '%s{"name": "e%d", "shape_1": "in/e%d.ply", "image_ct": "x.nrrd"}' "${more:-}" $i $i
    more=", "
done >rows
printf '{"data": [%s]}' "$(cat rows)" >p.swproj
expect 0 "" run p.swproj -o image --features ct:0 "${quick[@]}"
paste -d, <(tail -n +2 image/features.csv | cut -d, -f3) <(cat image/particles/e?_local.particles | awk '{ print $1 }') |
    awk -F, '{ d = $1 - $2; if (d > 0.01 || d < -0.01) bad++ } END { exit bad > 0 }' || fail "the image's values are not where they are"
printf '{"data": [%s], "optimize": {"use_normals": "true", "normals_strength": "0.4"}}' "$(cat rows)" >n.swproj
expect 0 "" run n.swproj -o normals "${quick[@]}"
tail -n +2 normals/history.csv | head -n 1 | cut -d, -f11 | grep -q . || fail "use_normals is not used"
expect 1 "method psm has no features" groom n.swproj -o q --method psm
expect 0 "" groom n.swproj -o ignored --ignore normals --faces 300

# ---- what is wrong ----
expect 1 "have no field 'heat'" groom bare in -o q --features heat
expect 2 "give NAME or NAME:WEIGHT" groom in -o q --features :1
expect 2 "a weight is a number" groom in -o q --features heat:-1
expect 2 "named twice" groom in -o q --features heat,heat
[ -e q ] && fail "a refused run left a folder"
exit $failed
