#!/bin/bash
# Parts that are labels of one segmentation, and with images that cut one of them off at other heights: the shaft leans by
# 3.4 degrees more from one subject to the next.
#   test_joint_labels.sh APSM
# shellcheck source=tests/cli/head.sh
. "$(dirname "$0")/head.sh"
command -v python3 >/dev/null || { echo "NOT TESTED: labels as parts; there is no Python"; exit 0; }
run=(--parts talus=1,shaft=2 -J 24 --faces 1200 --stage1-epochs 4 --stage2-epochs 2 --threads 1)
mkdir whole cuts
python3 "$here/joint_labels.py" whole 5 0 && python3 "$here/joint_labels.py" cuts 5 3 || exit 1

# Degrees by which the shaft leans more against the talus, from one subject to the next: least and most.
leans() {
    awk -F, 'NR == 1 { for (k = 1; k <= NF; k++) at[$k] = k; next } { x = $at["shaft_ry"] - $at["talus_ry"]; if (NR > 2) print x - last; last = x }' "$1/poses.csv"
}
for cohort in whole cuts; do
    expect 0 "5 of 5 joints certified" run $cohort -o $cohort.model "${run[@]}"
    leans $cohort.model | awk '{ s += $1 / 4; if (($1 - 3.43) ^ 2 > 4) bad = 1 } END { exit bad || NR != 4 || (s - 3.43) ^ 2 > 0.16 }' || fail "$cohort: the shaft leans by $(leans $cohort.model | tr '\n' ' ')"
    grep -q '"rebuilt_closed": 0,' $cohort.model/certificate.json || fail "$cohort: spaces close"
done
grep -q 's0: cropped to what all shapes hold: 2[0-9] % of its surface' said || fail "the shafts were not cropped"
grep -q '"cropped": 0.2' cuts.model/parts/shaft/manifest.json || fail "nothing says that shafts were cropped"
grep -q '"cropped": 0.[0-9]*[1-9]' cuts.model/parts/talus/manifest.json && fail "tali were cropped, too"
expect 0 "agree" verify cuts.model
grep -q '"of_images": true' cuts.model/manifest.json || fail "lengths of images are mm, and the joint does not say so"

# A subject whose image lacks a label misses that part.
mkdir lacking && cp whole/*.nrrd lacking
python3 - <<'P'
data = bytearray(open("lacking/s2.nrrd", "rb").read())
at = data.index(b"\n\n") + 2
data[at:] = bytes(0 if v == 2 else v for v in data[at:])
open("lacking/s2.nrrd", "wb").write(data)
P
expect 0 "s2: has no shaft" run lacking -o lacking.model "${run[@]}" --dry-run
# So does a new one; one that cannot be read, or has neither, fails alone.
mkdir new && cp lacking/s2.nrrd new && head -c 5000 whole/s3.nrrd >new/s3.nrrd
python3 - <<'P'
data = open("whole/s1.nrrd", "rb").read()
at = data.index(b"\n\n") + 1
open("new/s1.nhdr", "wb").write(data[:at] + b"data file: s1.raw\n")
open("new/s1.raw", "wb").write(data[at + 1:])
data = bytearray(open("whole/s4.nrrd", "rb").read())
at = data.index(b"\n\n") + 2
data[at:] = bytes(7 if v else 0 for v in data[at:])
open("new/s4.nrrd", "wb").write(data)
P
expect 1 "2 of 4 shapes were not fitted" fit whole.model new -o new.fit
grep -q '^s1,good,,no,,' new.fit/joint_fit.csv && grep -q '^s2,.*,no,shaft,' new.fit/joint_fit.csv || fail "missing: $(cut -d, -f1-5 new.fit/joint_fit.csv | tr '\n' ';')"
grep -q "\"sha256\": \"$(cat new/s1.nhdr new/s1.raw | sha256sum | cut -d' ' -f1)\"" new.fit/joint_fit.json || fail "the hash of s1 is not that of its header and voxels"
[ -s new.fit/meshes/s2_shaft_fit.ply ] || fail "the part that is in no voxel was not completed"

refused() { # refused CODE WORDS PARTS OPTION...
    expect "$1" "$2" run whole -o refused "${run[@]:2}" --parts "$3" "${@:4}"
    [ -e refused ] && fail "$3: a refused run left $(find refused | head -n 3)" && rm -rf refused
}
refused 2 "shaft='9' matches none of the 5 inputs" talus=1,shaft=9
refused 2 "label 1 is both talus and shaft" talus=1,shaft=1
refused 2 "label 2 is both" talus=1+2,shaft=2
refused 2 "the parts are labels" talus=1,shaft=2 --label 2
refused 2 "fewer than two parts" talus=1
refused 2 "a part without '='" talus=,shaft=2
refused 2 "labels and names of files are mixed" talus=1,shaft=two
refused 2 "no name of a part" 'ta lus=1,shaft=2'
exit $failed
