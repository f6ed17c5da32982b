#!/bin/bash
# Odd inputs: each works, or is refused with one line that names the file and the remedy, a code that
# is not 0, and no half folder.  $1 is the program; the files are made by odd_inputs.py.
source "$(dirname "$0")/head.sh"
command -v python3 >/dev/null || { echo "SKIPPED: odd inputs are not tested, there is no python3" && exit 0; }
python3 "$here/odd_inputs.py" . || exit 1

# refused FILE WORDS: by check, groom and info in the same words, by groom with nothing left.
refused() {
    expect 1 "$2" check "$1"
    expect 1 "$2" groom "$1" -o left
    [ "$(grep -c '^apsm: ' said)" = 1 ] || fail "groom $1: not one line: $(cat said)"
    [ -e left ] && fail "groom $1: leaves a half folder: $(ls left)" && rm -rf left
    return 0
}

# taken FILE WORDS: groomed, and the words said (if any).
taken() {
    expect 0 "$2" groom "$1" -o model --faces 1000
    rm -rf model
}

# ---- images that are no segmentation ----
refused oneslice.nii "is a flat image"
refused allzero.nii "segment the shape first"
refused onevoxel.nii "only 1 voxel;"
refused nan.nii "voxel (0, 0, 0) holds nan"
refused colours.nii "has colours"
refused fourd.nii "extract one volume"
refused probability.nii "--label '>0.5'"
refused two.nii "choose with --label"
refused scan.nii "of a scan, --label '>100'"
refused no_syntax.dcm "does not say how its data are written"
refused bz2.nrrd "save it as gzip or raw"
refused absent.mhd "absent.mhd: its data file 'nothere.raw' is not there"
taken float.nii ""
taken big.nii ""
taken gzip.nii ""
taken plain.nii.gz ""
taken negative.nii ""
taken negative_size.nii "a voxel size in its header is negative"
taken half_spacing.nrrd "does not say the spacing of every axis"
taken no_endian.nrrd "does not say the order of bytes"

# ---- a header whose slices are in files of their own: all of them are the input ----
expect 0 "" groom slices -o slices.model --faces 1000
grep -q "no shape" said && fail "slices of a header are said to hold no shape: $(cat said)"
expect 0 "" verify slices.model
printf '\1' | dd of=slices/s20.raw bs=1 seek=400 conv=notrunc 2>/dev/null
expect 1 "changed since it was groomed" verify slices.model

# ---- meshes ----
refused nan.ply "line 15: a coordinate is not finite"
refused points.vtk "a point cloud?"
refused far.ply "lies 1e+07 from the origin"
refused halves.ply "2 separate parts"
refused flat.ply "all its points lie in a plane, or on a line"
refused giant.ply "is 4e+201 long, which is no length of a shape"
refused comma.ply "line 11: expected a coordinate, found '5,1763809'"
for mesh in quads.ply negative.obj continued.obj strips.vtk version51.vtk big.ply solid.stl insideout.ply; do taken $mesh ""; done
taken far_unused.obj "1 unused vertices dropped"

# ---- formats of others, by name ----
for pair in a.mgz:"is empty" a.gii:"is empty" a.wrl:.ply a.mcs:.stl lh.curv:lh.white a.tif:"is empty" a.png:"flat picture" a.raw:.nhdr a.img:.hdr a.zip:unpack \
    a.xyz:"not a shape format"; do
    : >"${pair%%:*}"
    expect 1 "${pair##*:}" check "${pair%%:*}"
    expect 1 "${pair##*:}" info "${pair%%:*}"
done

# ---- projects without shapes ----
expect 1 "empty.swproj: names no shapes" check empty.swproj
expect 1 "nameless.swproj: shape 1 (x) names no input" check nameless.swproj

# ---- paths as Windows writes them, and a name twice, which is told once ----
mkdir sub && cp quads.ply sub && printf '{"data": [{"name": "a", "shape_1": "sub\\\\quads.ply"}, {"name": "a", "shape_1": "big.ply"}]}' >back.swproj
expect 0 "no problems found" check back.swproj
[ "$(grep -c "is now called" said)" = 1 ] || fail "a warning is told again: $(cat said)"

# ---- parameter files of ShapeWorks before version 6 ----
expect 0 "2 shapes" info old.xml
expect 0 "-J 32 takes as many" run old.xml -o old --dry-run --ignore fixed
expect 1 "--ignore fixed" run old.xml -o old --dry-run
expect 0 "" convert old.xml -o old.swproj
grep -q '"shape_1": "quads.ply"' old.swproj || fail "old.xml: its inputs are not in $(cat old.swproj)"
expect 1 "names no inputs; its point_files are particles" check points.xml
expect 1 "cutting_planes has 9 entries, where num_planes_per_input asks for 0" check planes.xml # test_old_projects.sh
expect 1 "torn.xml:3: " check torn.xml
expect 1 "entity.xml:1: " check entity.xml

# ---- places ----
expect 2 "is the folder of the whole system" run quads.ply -o /
expect 2 "is the folder of the whole system" groom quads.ply -o /tmp/..

# ---- texts of old and of other programs: lines that end in CR, a mark of byte order, UTF-16 ----
printf '\357\273\277x,y,z\r1,2,3\r4,5,6' >old.csv
expect 0 "particles: 2" info old.csv
printf '1 2 3\r4 5 6\r7 8 9\r' >old.particles
expect 0 "particles: 3" info old.particles
printf '\377\376x\0,\0y\0' >wide.csv
expect 1 "is text in UTF-16; save it as UTF-8" info wide.csv

# ---- what is said of something that is not there ----
expect 2 "only a project has domains" check quads.ply --domain tibia
expect 1 "no such file or folder" check quads.ply --constraints nowhere

# ---- names ----
expect 2 "control character" check newline
expect 2 "control character" check escape
grep -q $'\033' said && fail "an escape reached the terminal"
expect 0 "no problems" check "café o"

# ---- what a header left open is told after an interruption, too, in project and certificate ----
cp -r "$here/../data/cases/qsform" in
expect 0 "" groom in -o shared --shard 1/1 --faces 2000
expect 0 "4 of 4 shapes were groomed before" groom in -o shared --faces 2000
[ "$(grep -c '"input_notes"' shared/project.swproj)" = 3 ] || fail "notes of headers are lost on the way"
[ "$(grep -c '"text": "its \|"text": "neither' shared/manifest.json)" = 3 ] || fail "notes of headers are not in the manifest"

# ---- over the cohort: the hand that is not the others', and a stranger ----
expect 1 "m_hand_q1_s2: looks mirrored" check in

# ---- DICOM: a file with frames as it is, and what info says of a folder ----
expect 0 "label 2" info "$here/../data/cases/seg/f_seg_two"
expect 0 "label 2" info "$here/../data/cases/seg/f_seg_two/seg.dcm"
expect 0 "no model, but 4 shapes" info in
expect 0 "" groom "$here/../data/cases/seg/f_seg_two/seg.dcm" --label 1 -o file
expect 0 "" groom "$here/../data/cases/seg/f_seg_two" --label 1 -o series
cmp -s file/groomed/seg.ply series/groomed/f_seg_two.ply || fail "a DICOM file is not read as its folder is"

exit $failed
