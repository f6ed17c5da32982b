#!/bin/bash
# apsm fit and export from outside.  $1 is the program, $2 make_synthetic.
. "$(dirname "$0")/head.sh"

# fit CODE WORDS ARGUMENT...
fit() {
    local code=$1 words=$2
    shift 2
    "$apsm" fit "$@" >said 2>&1
    local got=$?
    [ $got -eq "$code" ] || fail "fit $*: exit code $got, not $code: $(cat said)"
    grep -qF -- "$words" said || fail "fit $* does not say '$words': $(cat said)"
}

# column NAME SHAPE FILE: of fit.csv.
column() {
    awk -F, -v name="$1" -v shape="$2" 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == name) c = i }
        $1 == shape { print $c }' "$3"
}

mkdir cohort new
for i in 0 1 2 3 4 5 6; do "$synthetic" bump cohort/s$i.ply index $i count 8 level 3; done
"$synthetic" bump new/whole.ply index 7 count 8 level 3
"$apsm" run cohort -o model -J 32 --faces 800 --stage1-epochs 3 --stage2-epochs 3 --quiet || fail run
find model -type f -exec cksum {} + | sort >before

# A new shape, in other poses.
"$synthetic" new/whole.ply new/turned.ply turn 140 shift 300
fit 0 "refused: 0; failed: 0" model new -o one --threads 1
fit 0 "refused: 0; failed: 0" model new -o two --threads 2
diff -r -x report.html one two >/dev/null || fail "threads change the files" # which tells its folder
find model -type f -exec cksum {} + | sort | cmp -s - before || fail "fit changed the model"
for f in particles/whole_local.particles particles/whole_world.particles \
    particles/whole_original.particles meshes/whole_fit.ply meshes/mean.ply shapes/whole.json report.html; do
    [ -s "one/$f" ] || fail "no $f"
done
[ "$(wc -l <one/particles/whole_world.particles)" -eq 32 ] || fail "not 32 particles"
awk -v d="$(column surface_mean whole one/fit.csv)" -v e="$(column surface_mean turned one/fit.csv)" \
    'BEGIN { exit !(d < 0.5 && e < 1.1 * d + 0.01) }' || fail "far: $(cat one/fit.csv)"
grep -q '"verdict": "certified"' one/shapes/whole.json || fail "not certified"

# Alone, and by a model file: the same bytes.
fit 0 "refused: 0; failed: 0" model new/whole.ply -o alone
cmp -s one/particles/whole_world.particles alone/particles/whole_world.particles ||
    fail "other shapes change a shape"
cmp -s one/meshes/whole_fit.ply alone/meshes/whole_fit.ply || fail "other shapes change a mesh"
"$apsm" export model --model m.apsm >/dev/null || fail export
"$apsm" export model --model m.apsm >said 2>&1 && fail "export overwrote"
"$apsm" export model --model m2.apsm >/dev/null && cmp -s m.apsm m2.apsm || fail "export differs"
fit 0 "refused: 0; failed: 0" m.apsm new/whole.ply -o file
cmp -s file/particles/whole_world.particles alone/particles/whole_world.particles ||
    fail "the model file fits otherwise than its folder"

# What the model keeps of its left-out shapes saves time and changes nothing; of another model it counts
# for nothing.
[ -s model/calibration.json ] || fail "no calibration"
cp -r model bare && rm bare/calibration.json
fit 0 "fitted" bare new/whole.ply -o bare_fit
same_fit() { diff <(grep -v '"path"' "$1/shapes/whole.json") <(grep -v '"path"' alone/shapes/whole.json) >/dev/null; }
same_fit bare_fit || fail "the calibration changes a fit"
cp -r model stale && sed -i 's/"noise": .*/"noise": 0.5,/; s/"of": "./"of": "x/' stale/calibration.json
"$apsm" fit stale new/whole.ply -o stale_fit >said 2>&1 || fail "stale: $(cat said)"
grep -q "calibration.json: is not of this model as it is now; calibrated again" said || fail "stale: $(cat said)"
same_fit stale_fit || fail "a stale calibration was taken"
cp -r model edited && sed -i 's/"modes": [0-9]*/"modes": 9999/' edited/calibration.json
"$apsm" fit edited new/whole.ply -o edited_fit >said 2>&1 || fail "edited: $(cat said)"
same_fit edited_fit || fail "a calibration of more modes than the model has was taken"

rm alone/report.html && "$apsm" report alone -q >said && cmp -s alone/report.html file/report.html &&
    fail "two folders have one title"
[ -s alone/report.html ] || fail "report of fits is not made again"
cp -r alone damaged
python3 -c '
import json
fits = json.load(open("damaged/fit.json"))
fits["shapes"].append([1])
json.dump(fits, open("damaged/fit.json", "w"), indent=4)'
"$apsm" report damaged -q >said 2>&1 && fail "a damaged fit.json makes a report"
grep -qF "value 2 of 'shapes' is no shape; fit again" said || fail "damaged: $(cat said)"
mkdir page && echo mine >page/report.html
fit 1 "holds a report.html that no fit has left" model new/whole.ply -o page
[ "$(cat page/report.html)" = mine ] || fail "a stranger's report was replaced"

# Strangers, and what is not a model.
"$synthetic" new/whole.ply half.ply scale 0.5
"$synthetic" torus torus.ply level 3
fit 1 "half: refused: is 0.5" model half.ply -o half
[ -e half/particles/half_world.particles ] && fail "a refused shape has particles"
fit 0 "fitted" model half.ply -o half --force --overwrite
fit 1 "refused" model torus.ply -o torus
"$synthetic" new/whole.ply giant.ply scale 1e12
fit 2 "--label 1: no input is an image" model half.ply -o labels --label 1
fit 1 "e+11 times as large as the model's mean" model giant.ply -o giant
fit 1 "holds fits already" model half.ply -o half
fit 1 "is a model folder" model half.ply -o model
fit 1 "no model folder" new/whole.ply half.ply -o x
head -c 3000 m.apsm >cut.apsm
fit 1 "or damaged" cut.apsm half.ply -o x
fit 2 "--hand left" model half.ply -o x --hand left
fit 2 "shapes behind the model" model -o x
[ -e x ] && fail "a mistake made a folder"

# More shapes than the page lists: those that were not fitted come last, and all are in the tables.
mkdir many && echo "no surface" >many/b1.ply
for i in $(seq 2 410); do cp many/b1.ply many/b$i.ply; done
fit 1 "failed: 410" model new/whole.ply many -o many_fits
[ "$(wc -l <many_fits/fit.csv)" -eq 412 ] || fail "not 411 lines in fit.csv"
[ "$(grep -c '"verdict": "failed"' many_fits/fit.json)" -eq 410 ] || fail "not 410 failed in fit.json"
if command -v python3 >/dev/null; then
    python3 - many_fits/report.html <<'END' >listed || fail "the page of many fits cannot be read"
import base64, json, re, sys, zlib
page = open(sys.argv[1], encoding="utf-8").read()
text = max(re.findall(r"[A-Za-z0-9+/=\s]{2000,}", page), key=len)
data = zlib.decompress(base64.b64decode("".join(text.split())))
fits = json.loads(data[4:4 + int.from_bytes(data[:4], "little")])
print(len(fits["table"]), fits["counts"]["failed"], fits["counts"]["good"] + fits["counts"]["needs review"], len(fits["shown"]))
END
    [ "$(cat listed)" = "400 410 1 1" ] || fail "the page of many fits: $(cat listed)"
else
    echo "SKIPPED: what a page of many fits lists; needs python3"
fi

# An opening: a part of the surface.
"$synthetic" bump new/open.ply index 7 count 8 level 3 hole 500
fit 0 "fitted" model new/open.ply -o open
grep -q '"partial": true' open/fit.json || fail "an open surface is taken for whole"
awk -v s="$(column observed_share open open/fit.csv)" 'BEGIN { exit !(s > 0.3 && s < 0.95) }' ||
    fail "share of the open surface: $(cat open/fit.csv)"

# A cloud, and landmarks.
awk '{ print $1 "," $2 "," $3 }' OFS=, one/particles/whole_original.particles |
    sed '1i x,y,z' >cloud.csv
fit 0 "fitted" model cloud.csv -o cloud
[ "$(wc -l <cloud/particles/cloud_world.particles)" -eq 32 ] || fail "no particles of a cloud"
awk 'BEGIN { print "name,x,y,z" } NR % 5 == 1 { print "p" NR "," $1 "," $2 "," $3 }' \
    model/particles/s0_world.particles >on_mean.csv
awk 'BEGIN { print "name,x,y,z" } NR % 5 == 1 { print "p" NR "," $1 "," $2 "," $3 }' \
    one/particles/turned_original.particles >points.csv
fit 0 "fitted" model points.csv --landmarks on_mean.csv -o landmarks
grep -q '"observed_share": 0' landmarks/fit.json || fail "landmarks: $(cat landmarks/fit.json)"
sed 's/^p1,/pX,/; s/^p31,/p1,/; s/^pX,/p31,/' points.csv >swapped.csv
fit 0 "landmark p1 is" model swapped.csv --landmarks on_mean.csv -o swapped
sed 's/^p/q/' points.csv >others.csv
fit 1 "0 of its points (the first is 'q1') have names that on_mean.csv has" model others.csv --landmarks on_mean.csv -o landmarks2
awk -F, 'NR > 1 { $2 += 50 } { print $1 "," $2 "," $3 "," $4 }' on_mean.csv >off_mean.csv
fit 0 "off the mean's surface" model points.csv --landmarks off_mean.csv -o landmarks3
awk -F, 'NR == 1 { print "name," $0; next } { print "c" NR "," $0 }' cloud.csv >named_cloud.csv
fit 0 "is fitted as a cloud of 32 points" model named_cloud.csv -o named_cloud
cmp -s cloud/particles/cloud_world.particles named_cloud/particles/named_cloud_world.particles || fail "names change a cloud"
yes 1,2,3 | head -50 | sed '1i x,y,z' >same.csv
fit 1 "only 1 of 50 points are different" model same.csv -o same_points
echo 'p1,1,2' >>points.csv
fit 1 "points.csv:9: is not name,x,y,z" model points.csv --landmarks on_mean.csv -o landmarks4

# Two models: the same one, one with other particles, and what is none.
"$apsm" compare model m.apsm -q >said 2>&1 || fail "compare: $(cat said)"
"$apsm" compare model model -q -o same >said 2>&1 || fail "compare: $(cat said)"
grep -q '^variation: 100.0 %' said || fail "a model is not like itself: $(cat said)"
awk -F, 'NR > 1 && ($2 > 1e-4 || $3 < 1 - 1e-9) { bad = 1 } END { exit bad || NR < 3 }' same/compare.csv ||
    fail "angles of a model with itself: $(cat same/compare.csv)"
"$apsm" run cohort -o finer -J 48 --faces 800 --stage1-epochs 3 --stage2-epochs 3 --quiet || fail run
"$apsm" compare model finer -q -o other --threads 1 >said 2>&1 || fail "compare: $(cat said)"
"$apsm" compare model finer -q -o again --threads 2 >said 2>&1 || fail "compare: $(cat said)"
diff -r other again >/dev/null || fail "threads change a comparison"
awk '/apart on average/ { exit !($3 < 0.6) }' said || fail "means far apart: $(cat said)"
grep -q 'shapes: [5-6] in both' said || fail "common shapes: $(cat said)"
"$apsm" compare model finer -o other >said 2>&1 && fail "a comparison was replaced"
"$apsm" compare model finer -o model >said 2>&1 && fail "compare wrote into a model"
"$apsm" compare model >said 2>&1 && fail "compare of one model"
mkdir mine && echo mine >mine/compare.csv
"$apsm" compare model finer -o mine --overwrite >said 2>&1 && fail "a stranger's file was replaced"
[ "$(cat mine/compare.csv)" = mine ] || fail "a stranger's file was replaced"

# Shapes leave and come back; the others stay byte for byte.
sum_of() { find model/groomed model/particles -name 's[0-5]*' -exec cksum {} + | sort -k 3; }
template=$(sed -n 's/.*"template_used": "\(.*\)".*/\1/p' model/project.swproj)
leaver=s6
[ "$template" = s6 ] && leaver=s5
sum_of | grep -v "/${leaver}_" | grep -v "/$leaver\." >kept_before
awk -F, 'NR == 1 { print "name,age" } NR > 1 { print $1 "," 30 + NR % 5 }' model/scores.csv >ages.csv
"$apsm" test model --subjects ages.csv --formula '~ age' --on size >said 2>&1 || fail "test: $(cat said)"
"$apsm" exclude model $leaver >said 2>&1 || fail "exclude, the table names it: $(cat said)"
"$apsm" verify model >said 2>&1 || fail "verify after exclude: $(cat said)"
grep -q $leaver model/scores.csv && fail "an excluded shape has scores"
"$apsm" exclude model "$template" >said 2>&1 && fail "the template was excluded"
"$apsm" exclude model nobody >said 2>&1 && fail "nobody was excluded"
"$apsm" verify model >said 2>&1 || fail "verify after refused excludes: $(cat said)"
"$apsm" add model half.ply >said 2>&1 && fail "a stranger was added"
"$apsm" verify model >said 2>&1 || fail "verify after a refused add: $(cat said)"
"$apsm" add model cohort/$leaver.ply new/turned.ply >said 2>&1 || fail "add: $(cat said)"
"$apsm" verify model >said 2>&1 || fail "verify after add: $(cat said)"
[ "$(wc -l <model/scores.csv)" -eq 9 ] || fail "not 8 shapes after add"

# Of new files it may be said which side they are; that says nothing of the model's.
"$synthetic" cohort/$leaver.ply left_one.ply mirror 1
cp model/project.swproj project_before
"$apsm" add model left_one.ply --reflect-match left_ >said 2>&1 || fail "add of a left one: $(cat said)"
# The kind is nearly its own mirror image, so only the project shows that it was turned over.
awk '/"name": "left_one"/ { its = 1 } its && /"mirrored"/ { print $2; exit }' model/project.swproj | grep -q yes ||
    fail "the left one was not turned over"
grep '"reflect_match"' model/project.swproj | cmp -s - <(grep '"reflect_match"' project_before) ||
    fail "the model's options changed"
sum_of | grep -v "/${leaver}_" | grep -v "/$leaver\." | cmp -s - kept_before ||
    fail "the others' files changed"

# A shape that is there twice is told where the model is made and where it grows, and in its files.
cp cohort/$leaver.ply again.ply
"$apsm" add model again.ply >said 2>&1 || fail "add of a shape again: $(cat said)"
grep -q "again: the same file as $leaver, byte for byte" said || fail "nothing said of a shape twice: $(cat said)"
grep -q "the same file as $leaver, byte for byte" model/certificate.json || fail "no note of a shape twice"
"$apsm" verify model >said 2>&1 || fail "verify after add again: $(cat said)"
mkdir twice && cp cohort/s1.ply cohort/s2.ply twice && cp cohort/s1.ply twice/s3.ply
"$apsm" groom twice -o groomed_twice --faces 400 -q >said 2>&1
grep -q "the same file as s1, byte for byte" groomed_twice/manifest.json || fail "no note in the manifest: $(cat said)"
exit $failed
