#!/bin/bash
# convert and info on particles: around all formats and back, a model to one array and back, and
# nothing written where something is wrong.  $1 is the program, $2 make_synthetic.
set -u
apsm=$1
synthetic=$2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
failed=0
fail() {
    echo "$*"
    failed=1
}
convert() { "$apsm" convert --quiet "$@" || fail "convert $* fails"; }
refuse() { # WORDS ARGUMENT...
    local words=$1 said
    shift
    said=$("$apsm" convert "$@" 2>&1) && fail "convert $*: is not refused"
    grep -qF -- "$words" <<<"$said" || fail "convert $*: does not say '$words': $said"
    [ "$(wc -l <<<"$said")" -eq 1 ] || fail "convert $*: more than one line: $said"
}

# Around: the last file is the first.
printf '0.1 -2 3e-05\n4.5 123456.789 -6\n7 8 9.25\n' >start.particles
from=start.particles
for extension in csv npy mrk.json vtk vtp lpts wpts particles; do
    convert $from -o around.$extension
    "$apsm" info around.$extension | grep -qx 'particles: 3' || fail "info around.$extension"
    from=around.$extension
done
cmp start.particles around.particles || fail "the way around changes particles"

# A model to one array, in the order of the project, and back.
mkdir model
printf '1 2 3\n4 5 6\n' >model/zoe.particles
printf '7 8 9\n10 11 12.5\n' >model/adam.particles
cat >model/project.swproj <<'END'
{ "data": [ { "name": "zoe", "shape_1": "zoe.ply", "world_particles_1": "zoe.particles" },
            { "name": "adam", "shape_1": "adam.ply", "world_particles_1": "adam.particles" } ],
  "project": { "version": "2" } }
END
convert model -o all.npy
convert model/project.swproj -o same.npy
cmp all.npy same.npy || fail "folder and project differ"
"$apsm" info all.npy | grep -qx 'particles: 2 on each of 2 shapes' || fail "info all.npy"
[ "$(stat -c %s all.npy)" -eq $((128 + 2 * 2 * 3 * 8)) ] || fail "size of all.npy"
convert all.npy -o back --to particles
cmp model/zoe.particles back/all_1.particles || fail "first shape of all.npy"
cmp model/adam.particles back/all_2.particles || fail "second shape of all.npy"
convert back/all_1.particles back/all_2.particles -o again.npy
cmp all.npy again.npy || fail "files to one array"
convert model -o slicer --to .mrk.json
convert slicer/zoe.mrk.json -o zoe.particles
cmp model/zoe.particles zoe.particles || fail "Slicer's markups"

# evaluate reads any of them.
mkdir eval
for i in 0 1 2 3; do printf '0 0 %d\n1 0.5 %d\n0 1 2\n%d 1 3\n' $i $((i * i)) $((i + 1)) >eval/$i.lpts; done
for extension in lpts particles wpts csv npy mrk.json vtk vtp; do
    [ $extension = lpts ] || convert eval/?.lpts -o eval --to $extension
    "$apsm" evaluate --quiet eval/?.$extension >eval_$extension || fail "evaluate *.$extension"
    cmp eval_lpts eval_$extension || fail "evaluate differs on .$extension"
done

# Projects: from one format to the other and back, to be read from another folder; evaluate reads both
# and finds the meshes.
mkdir many elsewhere
for i in 1 2 3 4; do
    "$synthetic" ellipsoid many/e$i.ply level 3 index $((i - 1)) count 4
    row="{ \"name\": \"e$i\", \"shape_1\": \"e$i.ply\", \"groomed_1\": \"e$i.ply\", \"age\": \"$((40 + i))\",
        \"world_particles_1\": \"e${i}_world.particles\" }"
    rows="${rows:+$rows, }$row"
done
echo "{ \"data\": [ $rows ], \"groom\": { \"1\": { \"blur\": \"true\" } }, \"mine\": { \"k\": \"v\" } }" \
    >many/p.swproj
for i in 1 2 3 4; do
    for k in 0 1 2 3 4 5 6 7 8 9; do
        awk -v i=$i -v k=$k 'BEGIN { t = 2.4 * k; z = (k - 4.5) / 5; r = sqrt(1 - z * z)
            print (10 + i) * r * cos(t), 7 * r * sin(t), 5 * z }'
    done >many/e${i}_world.particles
    cp many/e${i}_world.particles many/e${i}_local.particles
done
convert many/p.swproj -o elsewhere/p.xlsx
convert elsewhere/p.xlsx -o elsewhere/q.swproj
grep -q '"age": "43"' elsewhere/q.swproj || fail "a column is lost in the spreadsheet"
grep -q '"blur": "true"' elsewhere/q.swproj || fail "options of a domain are lost"
grep -q '"k": "v"' elsewhere/q.swproj || fail "an unknown group is lost"
grep -q '"../many/e2_world.particles"' elsewhere/q.swproj || fail "paths are not rewritten"
convert many/p.swproj -o many.npy
convert elsewhere/p.xlsx -o xlsx.npy
cmp many.npy xlsx.npy || fail "particles of a spreadsheet differ"
"$apsm" info elsewhere/p.xlsx | grep -q 'project: 4 shapes' || fail "info on a spreadsheet"
"$apsm" evaluate -q many/e?_world.particles >eval_files || fail "evaluate on files"
"$apsm" evaluate -q many.npy | cmp - eval_files || fail "evaluate on an array"
sed -i 's/"groomed_1": "[^"]*", //' many/p.swproj
"$apsm" evaluate -q many/p.swproj | cmp - eval_files || fail "evaluate on a project without meshes"

# Traps of other programs are told, not inherited.
warns() { # WORDS COMMAND...
    local words=$1
    shift
    "$apsm" "$@" 2>&1 | grep -qF -- "$words" || fail "apsm $*: does not warn '$words'"
}
printf '1 2 3\n4 5 6' >cut.particles
warns "would lose the last one" convert cut.particles -o cut.csv
[ "$(wc -l <cut.csv)" -eq 3 ] || fail "the last particle is lost"
warns "different frames" convert many/e1_local.particles many/e1_world.particles -o both --to csv
warns "are not aligned" evaluate many/e?_local.particles
sed 's/LPS/RAS/' slicer/zoe.mrk.json >ras.mrk.json
warns "is in RAS" convert ras.mrk.json -o ras.csv
"$apsm" evaluate many/e?_*.particles 2>&1 | grep -q "different frames" || fail "frames are mixed"

# Meshes of the same format follow their particles, and alone are none.
"$apsm" evaluate -q many/e?_world.particles many/e?.ply >/dev/null 2>said && fail "other particles pass"
grep -q "are not on it" said || fail "evaluate with meshes: $(cat said)"
convert many/e?_world.particles -o vtk --to vtk
"$apsm" evaluate -q vtk/e?_world.vtk | cmp - eval_files || fail "evaluate on points of VTK"
printf '# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\nPOLYGONS 1 4\n3 0 1 2\n' >mesh.vtk
"$apsm" evaluate mesh.vtk mesh.vtk mesh.vtk 2>&1 | grep -q "holds no particles; they come first" || fail "meshes pass for particles"
mkdir -p folder && "$apsm" certify folder 2>&1 | grep -q "is a folder; give its project.swproj" || fail "certify of a folder"

# What is wrong leaves nothing behind.
before=$(find . | sort)
echo '1 2' >bad.particles
before="$before"$'\n'./bad.particles
refuse "bad.particles:1" start.particles bad.particles -o none --to csv
refuse "cannot hold 2 shapes" model -o none.csv
refuse "one array needs the same number" start.particles zoe.particles -o none.npy
refuse "two inputs would be written to none/start.csv" start.particles model/../start.particles \
    -o none --to csv
refuse "is an input" start.particles around.csv -o . --to particles
refuse "is a folder" start.particles -o model
refuse "no project.swproj" back -o none.npy
refuse "would be replaced" many/p.swproj -o many/p.swproj
refuse "one project or model folder only" start.particles -o none.swproj
refuse "one project or model folder only" model many/p.swproj -o none.xlsx
refuse "not a format of particles" start.particles -o none.json
refuse "none.ply" none.ply -o none.csv
[ "$(find . | sort)" = "$(sort <<<"$before")" ] || fail "something was left behind"

# What is there already is not replaced unasked.
echo mine >mine.csv && mkdir -p theirs && echo mine >theirs/start.csv
refuse "mine.csv: is there already" start.particles -o mine.csv
refuse "start.csv: is there already" start.particles -o theirs --to csv
refuse "p.xlsx: is there already" many/p.swproj -o elsewhere/p.xlsx
[ "$(cat mine.csv theirs/start.csv)" = "$(printf 'mine\nmine')" ] || fail "a file was replaced"
convert start.particles -o mine.csv --overwrite
grep -q mine mine.csv && fail "--overwrite does not replace"
exit $failed
