#!/bin/bash
# Contours as shapes.  $1 is the program, $2 make_synthetic.
. "$(dirname "$0")/head.sh"

mkdir in
for i in 0 1 2 3 4; do "$synthetic" supershape in/s$i.vtk index $i count 5 || exit 1; done
expect 0 "5 closed contours, 48 particles" run in -o m -J 48
sed -n 's/.*compactness \([0-9.]*\).*/\1/p' said | awk '{ exit !($1 > 0.97) }' || fail "more than one mode: $(cat said)"
awk -F, 'NR > 1 && ($2 > 0.15 || $3 > 1.5) { bad = 1 } END { exit bad }' m/evaluation.csv || fail "far: $(cat m/evaluation.csv)"
[ "$(cat m/particles/s?_world.particles | wc -l)" -eq 240 ] || fail "particles"
expect 2 "made by one process" run in -o no -J 48 --shard 2/3
[ -e no ] && fail "a share of contours makes a folder"
expect 0 "project: 5 shapes" info m
expect 0 "particles: 48" info m/particles/s1_local.particles
expect 0 "" evaluate m/particles/s?_world.particles
expect 0 "" run in -o n -J 48 --threads 2
cmp m/model.json n/model.json >&2 || fail "another number of threads, another model"
# Lines in any order, and ends that are joined: the same contour.
awk '/^LINES/ { print; inside = 1; next } inside { l[n++] = $0; next } { print }
    END { for (k = 0; k < n; k++) print l[(k * 7) % n] }' in/s2.vtk >mixed.vtk
mkdir mixed && cp in/s[0134].vtk mixed && cp mixed.vtk mixed/s2.vtk
expect 0 "" run mixed -o o -J 48
cmp m/scores.csv o/scores.csv >&2 || fail "the order of the lines matters"

# ---- the certificate: a shape of three equal lobes is told by how it lies, or not at all ----
expect 0 "5 of 5 contours certified" run in -o c -J 48
mkdir turned lone
turn() { awk -v a="$1" '/^LINES/ { l = 1 } !l && NF == 3 && !/[A-Z#]/ { printf "%.9f %.9f 0\n", cos(a) * $1 - sin(a) * $2, sin(a) * $1 + cos(a) * $2; next } { print }' "$2"; }
bend() { awk '/^LINES/ { l = 1 } !l && NF == 3 && !/[A-Z#]/ { print $1 * (1 + 0.004 * $1), $2 + 0.004 * $1 * $2 + 0.1 * $1, 0; next } { print }' "$1"; }
for i in 0 1 2 3 4; do
    turn $((i * 2)) in/s$i.vtk >turned/s$i.vtk
    bend in/s$i.vtk >bent.vtk
    turn $((i * 2)) bent.vtk >lone/s$i.vtk
done
expect 0 "needs review: ambiguous" run turned -o d -J 48
grep -q '"certified": 0' d/certificate.json || fail "lobes that cannot be told apart are certified: $(grep -m 1 certified d/certificate.json)"
expect 0 "5 of 5 contours certified" run lone -o e -J 48

# ---- a project's column contour_1: its rows and columns are kept ----
printf '{"data": [{"name": "one", "contour_1": "in/s0.vtk", "group_side": "L"}, {"name": "two", "contour_1": "in/s1.vtk"},
 {"name": "no", "contour_1": "in/s2.vtk", "excluded": "yes"}, {"name": "four", "contour_1": "in/s3.vtk"}], "studio": {"a": "b"}}' >p.swproj
expect 0 "3 of 3 contours certified" run p.swproj -o p -J 48
for words in '"group_side": "L"' '"excluded": "yes"' '"a": "b"' '"contour_1": "../in/s1.vtk"' particles/four_world.particles; do
    grep -qF -- "$words" p/project.swproj || fail "the project has lost $words"
done
expect 0 "3 of 3 shapes certified" info p
[ "$(cut -d, -f1 p/scores.csv | tail -n +2 | tr '\n' ' ')" = "$(tr ',' '\n' <p/project.swproj | sed -n 's/.*"name": "\([a-z]*\)".*/\1/p' | grep -v no | tr '\n' ' ')" ] ||
    fail "scores in another order than the project's"
grep -q 'do not belong' said && fail "info of contours: $(cat said)"
sed "s/contour_1/shape_1/g" p.swproj >shape.swproj
expect 0 "3 of 3 contours certified" run shape.swproj -o s -J 48
cmp p/model.json s/model.json >&2 || fail "shape_1 names another contour than contour_1"
grep -qF '"shape_1": "../in/s1.vtk"' s/project.swproj || fail "shape_1 of a contour is lost"
sed 's/"group_side": "L"/"constraints_1": "c.json"/' p.swproj >cut.swproj
expect 1 "one has constraints" run cut.swproj -o r -J 48
expect 0 "" run cut.swproj -o r -J 48 --ignore constraints
grep -qF '"constraints_1": "../c.json"' r/project.swproj || fail "ignored constraints are lost"
sed 's/"contour_1": "in\/s1.vtk"/"group_side": "R"/' p.swproj >none.swproj
expect 2 "two has no contour" run none.swproj -o q -J 48

# ---- what is wrong ----
expect 1 "continue it with --resume" run in -o m -J 48
# ---- report, verify, resume ----
[ "$(grep -c '<html' m/report.html)" -eq 1 ] && [ "$(wc -c <m/report.html)" -gt 100000 ] || fail "no report"
expect 0 "agree" verify m
files=$(tail -n 1 said)
for verb in report optimize evaluate; do expect 1 "holds a model of contours" $verb m; done
expect 0 "$files" verify m
expect 1 "the inputs are contours" run in -o p --parts a=c,b=d
expect 0 "nothing to do" run in -o m -J 48 --resume
expect 1 "begun with other options" run in -o m -J 40 --resume
expect 2 "give its inputs again" run -o m --resume
cp -r m whole
rm -r m
(ulimit -f 60; "$apsm" run in -o m -J 48 -q) 2>said && fail "the report had no place"
grep -q '"finished": false' m/manifest.json && [ -e m/model.json ] || fail "an interruption: $(cat said)"
echo mine >m/notes.txt
expect 0 "5 of 5 contours certified" run in -o m -J 48 --resume
for file in model.json scores.csv contours/mean.vtk report.html certificate.json; do cmp -s m/$file whole/$file || fail "resumed: another $file"; done
grep -q notes.txt m/manifest.json && fail "a file of the user is listed"
expect 0 "agree" verify m
echo >>m/scores.csv
expect 1 "scores.csv" verify m
cp in/s2.vtk kept.vtk && cp in/s3.vtk in/s2.vtk
expect 1 "other contours, or they have changed" run in -o m -J 48 --resume
cp kept.vtk in/s2.vtk
expect 0 "5 of 5" run in -o m -J 48 --overwrite
expect 0 "agree" verify m
cp -r whole hurt && echo >>hurt/scores.csv
expect 1 "scores.csv" run in -o hurt -J 48 --resume
# What is the user's is neither listed, nor replaced, nor removed; of a larger model before nothing stays.
cp -r whole less
echo mine >less/notes.txt && cp in/s0.vtk less/contours/drawn.vtk
expect 0 "4 of 4 contours certified" run in -o less -J 48 --overwrite --exclude s4
[ -e less/particles/s4_world.particles ] && fail "particles of a larger model before stay"
[ -e less/contours/mode_04_plus2sd.vtk ] && fail "modes of a larger model before stay"
[ -e less/contours/mode_03_plus2sd.vtk ] || fail "modes are gone"
cmp -s in/s0.vtk less/contours/drawn.vtk && [ -e less/notes.txt ] || fail "files of the user are gone"
grep -q 'notes.txt\|drawn.vtk' less/manifest.json && fail "files of the user are listed"
grep -q '"files"' less/manifest.json && fail "a whole model lists files that are to come"
expect 0 "agree" verify less
echo mine >less/particles/s4_world.particles
cp less/manifest.json before.json
expect 1 "s4_world.particles: was not written by apsm" run in -o less -J 48 --overwrite
cmp before.json less/manifest.json && grep -q mine less/particles/s4_world.particles || fail "a refused run has changed the folder"
rm less/particles/s4_world.particles
sed -i 's/"finished": true/"finished": false/' less/manifest.json
expect 1 "manifest.json: changed since" run in -o less -J 48 --overwrite
# A received model whose sealed manifest names files of others: they stay.
rm -rf less && cp -r whole less && echo mine >less/notes.txt && echo mine >others.txt
sed -i "s|\"outputs\": {|&\"notes.txt\": [\"contours\", 5, \"\"], \"../others.txt\": [\"contours\", 5, \"\"],|" less/manifest.json
seal less/manifest.json
expect 0 "nothing to do" run in -o less -J 48 --resume
expect 0 "5 of 5" run in -o less -J 48 --overwrite
[ -e less/notes.txt ] && [ -e others.txt ] || fail "a manifest made apsm remove files of others"
mkdir -p curves/contours && cp in/s0.vtk curves/contours/mean.vtk
expect 1 "is not empty" run in -o curves -J 48
cmp -s in/s0.vtk curves/contours/mean.vtk || fail "curves of the user were replaced"
mkdir mine && echo 1 >mine/notes.txt
expect 1 "is not empty" run in -o mine -J 48 --overwrite
expect 1 "has no meaning" run in -o q --gamma 1
expect 2 "none of the 5 contours" run in -o q --template s9
sed 's/^2 0 1$/2 0 90/' in/s0.vtk >in/x.vtk
expect 1 "x.vtk: its lines are not one contour" run in -o q
sed -e '/^2 0 1$/d' -e 's/^LINES 180 540/LINES 179 537/' in/s0.vtk >in/x.vtk
expect 2 "all closed or all open" run in -o q
sed -i 's/^2 3 4$/2 3 999/' in/x.vtk
expect 1 "x.vtk" run in -o q
[ -e q ] && fail "a refused run left a folder"
exit $failed
