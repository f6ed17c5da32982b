#!/bin/bash
# From a cohort with a planted difference to its answer.  $1 is the program, $2 make_synthetic.
. "$(dirname "$0")/head.sh"
refuse_verb() { # VERB CODE WORDS ARGUMENT...
    local verb=$1 code=$2 words=$3 said
    shift 3
    said=$("$apsm" "$verb" "$@" 2>&1)
    local got=$?
    [ $got -eq "$code" ] || fail "$verb $*: exit code $got, not $code: $said"
    grep -qF -- "$words" <<<"$said" || fail "$verb $*: does not say '$words': $said"
}

refuse() { # CODE WORDS ARGUMENT...
    local code=$1 words=$2 said
    shift 2
    said=$("$apsm" test "$@" 2>&1)
    local got=$?
    [ $got -eq "$code" ] || fail "test $*: exit code $got, not $code: $said"
    grep -qF -- "$words" <<<"$said" || fail "test $*: does not say '$words': $said"
}
# A number of a JSON file of ours, by its key.
number() { sed -n "s/^ *\"$2\": \([-0-9.e]*\),*$/\1/p" "$1"; }

# Twelve ellipsoids of varying axes; those of group big are larger by a fifth.
mkdir shapes
echo "name,group,age" >table.csv
for i in 0 1 2 3 4 5 6 7 8 9 10 11; do
    group=big scale=1.2
    [ $((i % 2)) -eq 1 ] && group=small scale=1
    "$synthetic" ellipsoid shapes/s$i.ply level 3 index $((i * 5 % 12)) count 12 wobble 0.02 \
        seed $((i + 1)) scale $scale || exit 1
    echo "s$i,$group,$((20 + i * 7 % 12))" >>table.csv
done
"$apsm" run shapes -o model -J 32 --faces 1000 --stage1-epochs 3 --stage2-epochs 2 --quiet \
    >said 2>&1 || fail "no model: $(tail -n 3 said)"

"$apsm" test model --subjects table.csv --formula '~ group + age' --on size >said 2>&1 ||
    fail "size: $(tail -n 1 said)"
p=$(number model/statistics/group_size.json p)
# All 12! orders are too many; with age in the model the smallest p of 10,000 draws is 1 / 10,001.
awk -v p="$p" 'BEGIN { exit !(p < 0.01) }' || fail "sizes that differ by a fifth: p = $p"
grep -q 'big minus small' model/statistics/group_size.csv || fail "no effect in the table"

"$apsm" test model --subjects table.csv --formula '~ group' --on size --quiet || fail "exact"
"$apsm" verify model >said 2>&1 || fail "a renewed report is not the model's: $(tail -n 1 said)"
grep -q '"exact": true' model/statistics/group_size.json || fail "924 orders are not gone through"
[ "$(number model/statistics/group_size.json permutations)" = 924 ] || fail "not 924 orders"

# Size taken out, nothing is left to be found (the axes do not go with the groups).
"$apsm" test model --subjects table.csv --formula '~ group' --on shape --permutations 500 --quiet
p=$(number model/statistics/group_shape.json p)
awk -v p="$p" 'BEGIN { exit !(p > 0.02) }' || fail "shapes that do not differ: p = $p"
[ "$(wc -l <model/statistics/group_shape.csv)" -eq 33 ] || fail "not a line a particle"

# The same bytes with two threads, and other draws with another seed.
for threads in 1 2; do
    "$apsm" test model --subjects table.csv --formula '~ group + age' -o t$threads \
        --permutations 300 --threads $threads --quiet || fail "threads $threads"
done
cmp -s t1/group_form.json t2/group_form.json || fail "another result with two threads"
"$apsm" test model --subjects table.csv --formula '~ group + age' -o t3 --permutations 300 \
    --seed 5 --quiet
cmp -s t1/group_form.json t3/group_form.json && fail "the seed does not matter"

# The table by another program's arithmetic: the difference of mean sizes.
want=$(awk -F, 'NR > 1 { print $1, $2 }' table.csv | while read -r name group; do
    awk -v g="$group" '{ for (k = 1; k <= 3; k++) { s[k] += $k; q += $k * $k } n++ }
        END { print g, sqrt(q - (s[1]^2 + s[2]^2 + s[3]^2) / n) }' "model/particles/${name}_world.particles"
done | awk '{ s[$1] += $2; n[$1]++ } END { print s["big"] / n["big"] - s["small"] / n["small"] }')
"$apsm" test model --subjects table.csv --formula '~ group' --on size --quiet
got=$(awk -F, 'NR == 2 { print $8 }' model/statistics/group_size.csv)
awk -v g="$got" -v w="$want" 'BEGIN { d = g - w; exit !(d * d < 1e-6 * w * w) }' ||
    fail "difference of mean sizes is $got, not $want"

refuse 2 "no column 'grup'" model --subjects table.csv --formula '~ grup'
refuse 2 "is no term of the formula" model --subjects table.csv --formula '~ group' --of age
refuse 2 "give form, shape, size or modes" model --subjects table.csv --formula '~ group' --on form2
refuse 2 "give a whole number" model --subjects table.csv --formula '~ group' --permutations ten
refuse 2 "needs a formula" model
sed 's/^s3,/s33,/' table.csv >bad.csv
refuse 2 "bad.csv:5: 's33' is no shape of the model" model --subjects bad.csv --formula '~ group'
refuse 1 "no-such.csv" model --subjects no-such.csv --formula '~ group'
sed '2,10s/,[0-9]*$/,/' table.csv >few.csv
refuse 2 "too few" model --subjects few.csv --formula '~ group + age'

# As spreadsheets save it: the separator above, empty fields below.
{
    printf 'sep=;\r\n'
    tr , ';' <table.csv | sed 's/$/\r/'
    printf ';;\r\n;;\r\n'
} >sheet.csv
"$apsm" test model --subjects sheet.csv --formula '~ group + age' --on size -o sheet -q || fail "a spreadsheet's table"
"$apsm" test model --subjects table.csv --formula '~ group + age' --on size -o plain -q || fail "a plain table"
cmp sheet/group_size.csv plain/group_size.csv || fail "a spreadsheet's table has other results"
# A title that holds another separator, in quotes or not, also in the table that the model keeps.
sed '1s/.*/name,group,"age; in years"/' table.csv >titled.csv
"$apsm" test model --subjects titled.csv --formula '~ group' --on size -o titled -q || fail "a title with a semicolon"
cp -r model titles && rm -rf titles/statistics
tr , '\t' <table.csv | sed '1s/age/age;years/' >titled.tsv
"$apsm" test titles --subjects titled.tsv --formula '~ group' --on size -q && "$apsm" test titles --formula '~ group' --on size -q ||
    fail "the kept table is not read again"

# Columns that were meant to be numbers are not taken as groups without a word.
sed '4s/[0-9]*$/about 30/' table.csv >odd.csv
refuse 2 "column 'age': 'about 30' is no number" model --subjects odd.csv --formula '~ group + age'
sed '2,$s/,/;/g;2,$s/$/,5/;1s/,/;/g' table.csv >comma.csv
refuse 2 "column 'age': '31,5' is written with a comma" model --subjects comma.csv --formula '~ age'
refuse 2 "is written with a comma" model --subjects comma.csv --formula '~ group' --on age
refuse_verb predict 2 "is written with a comma" model --subjects comma.csv --of age
sed '2,$s/$/ years/' table.csv >words.csv
refuse 2 "'31 years' is no number, though it begins like one" model --subjects words.csv --formula '~ age'
sed '2,$s/,\([0-9]*\)$/,at \1/' table.csv >words.csv
refuse 2 "('age' holds texts such as 'at 20', 12 groups)" model --subjects words.csv --formula '~ age'
sed '2,$s/$/e300/' table.csv >huge.csv
refuse 2 "is beyond what can be reckoned with" model --subjects huge.csv --formula '~ group + age'
awk -F, '{ print NR - 1 "," $0 }' table.csv >rows.csv
refuse 2 "put column 'name' first" model --subjects rows.csv --formula '~ group'
printf 'name,group,gr\366\337e\ns0,big,1\n' >latin.csv
refuse 1 "latin.csv: is no text in UTF-8" model --subjects latin.csv --formula '~ group'
head -n 1 table.csv >none.csv
refuse 2 "no shape has a value in every column" model --subjects none.csv --formula '~ group'

# ---- ending early ----
"$apsm" test model --formula '~ group + age' --on size -o early --stop-risk 0.001 >said 2>&1 ||
    fail "stop-risk: $(cat said)"
grep -q '"early": true' early/group_size.json || fail "a clear difference goes through all orders: $(cat said)"
grep -q 'more would not change it' said || fail "ending early is not told: $(cat said)"
refuse 2 "give equal or unequal" model --formula '~ group' --variances none
refuse 2 "give a probability below 0.5" model --formula '~ group' --stop-risk 2

# ---- left and right: five subjects, one of them measured again ----
awk -F, 'NR == 1 { print "name,person,side,age"; next } { k = NR - 2; person = k > 9 ? 0 : int(k / 2)
    print $1 ",p" person "," (k % 2 ? "left" : "right") "," $3 }' table.csv >sides.csv
"$apsm" asymmetry model --subjects sides.csv --of side --within person --on size -o sides >said 2>&1 ||
    fail "asymmetry: $(cat said)"
grep -q 'not one side alone was mirrored' said || fail "sides that were not mirrored: $(cat said)"
grep -q '2 sides were measured more than once: fluctuating' said || fail "too few replicates: $(cat said)"
# The table and p by another program's arithmetic; sides of a subject change places in all 2^5 ways.
while IFS=, read -r name person side _; do
    [ "$name" = name ] || awk -v p="$person" -v d="$side" '{ for (k = 1; k <= 3; k++) { s[k] += $k; q += $k * $k } }
        END { printf "%s %s %.12g\n", p, d, sqrt(q - (s[1]^2 + s[2]^2 + s[3]^2) / NR) }' "model/particles/${name}_world.particles"
done <sides.csv | awk '{ sum[$1, $2] += $3; n[$1, $2]++; person[$1] = 1; x[NR] = $3; of[NR] = $1 SUBSEP $2 }
    function f(signs,  S, r, p, d, m, k, all, bar, ss_s, ss_d, ss_f) {
        for (p in person) { d[p] = (sum[p, "left"] / n[p, "left"] - sum[p, "right"] / n[p, "right"]) * (signs % 2 ? -1 : 1)
            m[p] = (sum[p, "left"] / n[p, "left"] + sum[p, "right"] / n[p, "right"]) / 2
            r += 1 / n[p, "left"] + 1 / n[p, "right"]; signs = int(signs / 2); S++; bar += d[p]; all += m[p] }
        r = 2 * S / r; bar /= S; all /= S
        for (p in person) { ss_f += r / 2 * (d[p] - bar)^2; ss_s += 2 * r * (m[p] - all)^2 }
        individuals = ss_s; return S * r / 2 * bar^2 / (ss_f / (S - 1)) }
    END { given = f(0); kept = individuals; for (k = 0; k < 32; k++) reached += f(k) >= given * (1 - 1e-9)
        for (k in x) error += (x[k] - sum[of[k]] / n[of[k]])^2
        printf "%.10g %.10g %.10g %.10g", kept, given, reached / 32, error }' >want
read -r individuals f p error <want
for figure in "individuals sum_of_squares $individuals" "directional f $f" "directional p $p" "error sum_of_squares $error"; do
    read -r source key want <<<"$figure"
    got=$(sed -n "/\"source\": \"$source\"/,/}/s/^ *\"$key\": \([-0-9.e]*\),*$/\1/p" sides/asymmetry_size.json)
    awk -v g="$got" -v w="$want" 'BEGIN { d = g - w; exit !(g != "" && d * d <= 1e-12 * w * w) }' ||
        fail "asymmetry: $key of $source is $got, not $want"
done
# Subjects that are numbers are subjects; sides have to be words.
sed 's/,p\([0-9]\),/,\1,/' sides.csv >numbered.csv
"$apsm" asymmetry model --subjects numbered.csv --of side --within person --on size -o numbered -q 2>said ||
    fail "subjects by number: $(cat said)"
cmp sides/asymmetry_size.json numbered/asymmetry_size.json || fail "numbers of subjects change the result"
sed 's/left/0/;s/right/1/' sides.csv >coded.csv
refuse_verb asymmetry 2 "it holds numbers" model --subjects coded.csv --of side --within person
# Each subject's amount is a column for the next test.
"$apsm" test model --subjects sides/asymmetry_size_subjects.csv --formula '~ age' --on asymmetry -o sides -q 2>/dev/null ||
    fail "amounts of asymmetry are no column"
grep -q '"subjects": 5' sides/age_asymmetry.json || fail "not one amount a subject"
"$apsm" asymmetry model --subjects sides.csv --of side --within person --bootstraps 0 --permutations 50 -o sides -q 2>/dev/null
[ "$(wc -l <sides/asymmetry_directional_form.csv)" -eq 33 ] || fail "no directional asymmetry of particles"
refuse_verb asymmetry 2 "no column with two sides" model --subjects sides.csv --of person --within side
refuse_verb asymmetry 2 "asymmetry needs the columns" model --subjects sides.csv --of side
sed 's/left/right/' sides.csv >one.csv
refuse_verb asymmetry 2 "no column with two sides" model --subjects one.csv --of side --within person
sed '4,5s/p1/p0/;8,9s/p3/p2/' sides.csv >few.csv
refuse_verb asymmetry 2 "5 at least are needed" model --subjects few.csv --of side --within person
mkdir theirs && echo mine >theirs/asymmetry_fluctuating_form.csv
refuse_verb asymmetry 1 "is not replaced" model --subjects sides.csv --of side --within person -o theirs
rm -r theirs

# ---- a column from the shape ----
"$apsm" predict model --of size_made --subjects table.csv >said 2>&1 && fail "predicted a column that is none"
awk 'BEGIN { print "name,reach,luck" }' >reach.csv
for f in model/particles/*_world.particles; do # the spread along x, and a word that means nothing
    name=$(basename "$f" _world.particles)
    awk -v n="$name" '{ s += $1; q += $1 * $1 } END { printf "%s,%.9g,%d\n", n, sqrt(q / NR - s * s / NR / NR), (NR * s * 1e7) % 7 }' "$f"
done >>reach.csv
for t in 1 2; do
    "$apsm" predict model --of reach --subjects reach.csv -o p$t --threads $t --at 4,5 --quiet || fail predict
done
diff -r p1 p2 >/dev/null || fail "another prediction with two threads"
[ -s p1/reach_prediction_at_4.ply ] || fail "no shape for a value"
share=$(sed -n 's/.*"share_explained": \(.*\),/\1/p' p1/reach_prediction.json)
awk -v s="$share" 'BEGIN { exit !(s > 0.5) }' || fail "what the shape shows is not predicted: $share"
want=$(awk -F, '$2 == "left out" { d = $3 - $4; r += d * d; s += $3; q += $3 * $3; n++ }
    END { print 1 - r / (q - s * s / n) }' p1/reach_prediction.csv)
awk -v g="$share" -v w="$want" 'BEGIN { d = g - w; exit !(d * d < 1e-8) }' || fail "share $share is not $want"
awk -F, 'NR == FNR { known[$1] = $2; next } $2 == "left out" { n++; d = known[$1] - $3; if (d * d > 1e-12) bad = 1 }
    END { exit bad || n < 8 }' reach.csv p1/reach_prediction.csv || fail "values of other subjects: $(cat p1/reach_prediction.csv)"
refuse_file() {
    mkdir -p theirs && echo mine >"theirs/$1"
    shift
    "$apsm" "$@" -o theirs >said 2>&1 && fail "$1 replaced a file: $(cat said)"
    grep -q 'is not replaced' said || fail "$1 says $(cat said)"
    [ "$(cat theirs/*)" = mine ] || fail "$1 changed a file"
    rm -r theirs
}
refuse_file reach_prediction.csv predict model --of reach --subjects reach.csv
refuse_file group_form.csv test model --subjects table.csv --formula '~ group'
refuse_verb predict 2 "no such column" model --of nobody
refuse_verb predict 2 "needs a column" model
refuse_verb predict 2 "give numbers" model --of reach --subjects reach.csv --at 4,x

# ---- measurements: shapes of known size ----
cat >define.json <<'END'
{"measurements": [{"name": "across", "kind": "distance", "points": [0, 1]},
 {"name": "volume", "kind": "volume"}, {"name": "area", "kind": "area"},
 {"name": "middle", "kind": "section", "points": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "whole": true}]}
END
"$apsm" measure model define.json --subjects table.csv >said 2>&1 || fail "measure: $(tail -n 1 said)"
[ "$(head -n 1 model/statistics/measurements.csv | cut -d, -f1-8)" = \
    name,across,volume,area,middle,surface_distance,centroid_size,group ] ||
    [ "$(head -n 1 model/statistics/measurements.csv | cut -d, -f1-5)" = \
        name,across,volume,area,middle ] || fail "columns of measurements.csv"
want=$(awk '{ for (k = 1; k <= 3; k++) p[NR, k] = $k } END { for (k = 1; k <= 3; k++)
    d += (p[1, k] - p[2, k])^2; print sqrt(d) }' model/particles/s4_world.particles)
got=$(awk -F, '$1 == "s4" { print $2 }' model/statistics/measurements.csv)
awk -v g="$got" -v w="$want" 'BEGIN { d = g - w; exit !(d * d < 1e-10 * w * w) }' ||
    fail "a distance of particles is $got, not $want"
# A table for test: volumes of the groups differ by 1.2^3.
"$apsm" test model --subjects model/statistics/measurements.csv --formula '~ volume + age' \
    --permutations 200 --quiet || fail "a measurement is no column"
"$apsm" test model --formula '~ group' --on volume --quiet || fail "a measurement cannot be tested"
p=$(number model/statistics/group_volume.json p) # the table is kept in the folder
awk -v p="$p" 'BEGIN { exit !(p < 0.01) }' || fail "volumes that differ by 1.7: p = $p"
"$apsm" report model --quiet || fail "no report"
sed -i 's/"model_sha256": "[0-9a-f]*/&0/' model/statistics/group_volume.json
"$apsm" report model 2>&1 | grep -q "is of another model" || fail "results of another model are shown"
echo '{ "name": ' >model/statistics/mine.json
"$apsm" report model >said 2>&1 || fail "a damaged file in statistics/ stops the report: $(cat said)"
[ "$(grep -c 'not in the report: .*mine.json' said)" -eq 1 ] || fail "a damaged file is not told once: $(cat said)"
# Numbers that say who are written as they were read.
awk -F, '{ print $1 "," (NR > 1 ? "00" NR : "who") }' table.csv >who.csv
"$apsm" measure model define.json --subjects who.csv -o m0 -q || fail "measure with numbers that say who"
who=$(awk -F, 'NR == 1 { for (k = 1; k <= NF; k++) if ($k == "who") at = k } $1 == "s4" { print $at }' m0/measurements.csv)
[ "$who" = 006 ] || fail "006 is written as $who"
rm -r model/statistics
"$apsm" measure model define.json --quiet && "$apsm" verify model >said 2>&1 ||
    fail "verify does not know measurements: $(tail -n 1 said)"

# ---- norms ----
awk 'NR == 5 { r = 1 + 12 / sqrt($1 * $1 + $2 * $2 + $3 * $3); $1 *= r; $2 *= r; $3 *= r } { print }' \
    model/particles/s4_world.particles >new_world.particles # outward, of an ellipsoid
(cat table.csv && echo new,small,25) >all.csv
"$apsm" norm model new_world.particles --subjects all.csv --formula '~ group + age' >said 2>&1 ||
    fail "norm: $(tail -n 1 said)"
grep -q 'particle p = 0.0769' said || fail "a particle far off is not the most unusual: $(cat said)"
[ "$(sort -t, -k8 -gr model/statistics/new_norm.csv | head -n 1 | cut -d, -f1)" = 4 ] ||
    fail "another particle is the most unusual"
for threads in 1 2; do
    "$apsm" norm model new_world.particles -o n$threads --threads $threads --quiet
done
cmp -s n1/norm.json n2/norm.json || fail "another norm with two threads"
# Along the surface nothing is seen; a model without its mean's surface says that all directions are judged.
cp -r model bare && rm -r bare/meshes bare/statistics
"$apsm" norm bare new_world.particles -o n7 -q >said 2>&1 || fail "norm without meshes: $(tail -n 1 said)"
grep -q '"normals": null' n7/norm.json && grep -q '"notes": \["the model has no mean surface' n7/norm.json ||
    fail "a norm in all directions does not say so"
awk 'NR == 5 { r = 3 / sqrt($1 * $1 + $2 * $2 + 1e-9); a = -$2 * r; $2 += $1 * r; $1 += a } { print }' \
    model/particles/s4_world.particles >slid_world.particles
"$apsm" norm model slid_world.particles -o n8 -q && "$apsm" norm bare slid_world.particles -o n9 -q >said 2>&1 ||
    fail "norm of a slide: $(cat said)"
[ "$(sort -t, -k8 -gr n9/slid_norm.csv | head -n 1 | cut -d, -f1)" = 4 ] || fail "a slide is not seen in all directions"
[ "$(sort -t, -k8 -gr n8/slid_norm.csv | head -n 1 | cut -d, -f1)" != 4 ] || fail "a slide along the surface is judged"
# What to know before it is trusted is in the results, too.
awk -F, 'NR == 1 { print $0 ",odd"; next } $1 == "new" { $3 = 90 } { print $1 "," $2 "," $3 "," (NR == 4 ? "lost" : NR) }' all.csv >old.csv
"$apsm" norm model new_world.particles --subjects old.csv --formula '~ age + group + age:group' -o n6 -q >said 2>&1 ||
    fail "norm of an old one: $(cat said)"
for words in "age = 90 lies outside" "column 'odd' is not judged: 'lost' is no number"; do
    [ "$(grep -cF "$words" said)" = 1 ] || fail "not told once: $words: $(cat said)"
done
grep -qF '"note": "age = 90 lies outside of what the model has seen (20 to 31)"' n6/norm.json ||
    fail "a person beyond the norm is not in norm.json"
tail -n 1 n6/norm.csv | grep -qF ',age = 90 lies outside' || fail "a person beyond the norm is not in norm.csv"
grep -qF "\"notes\": [\"column 'odd' is not judged" n6/norm.json || fail "what is not judged is not in norm.json"
awk -F, '{ print $0 (NR == 1 ? ",site" : $1 == "new" ? ",.2" : ",.1") }' all.csv >site.csv
"$apsm" norm model new_world.particles --subjects site.csv -o n10 -q >said 2>&1
grep -qF "\"notes\": [\"'site' is not judged: the norm's shapes do not differ in it\"" n10/norm.json || fail "a number of one value is judged: $(cat said)"
grep -q '"note": null' n1/norm.json || fail "a note of a shape that has none"
head -n 30 new_world.particles >short.particles
refuse_verb norm 2 "has 30 particles, the model 32" model short.particles
sed 's/[0-9] *$/&e200/' new_world.particles >far.particles
refuse_verb norm 2 "times as far from the origin" model far.particles
refuse_verb norm 2 "give a line for it" model new_world.particles --subjects table.csv --formula '~ age'
sed 's/new,small/new,tiny/' all.csv >tiny.csv
refuse_verb norm 2 "has group = tiny" model new_world.particles --subjects tiny.csv --formula '~ group'
refuse_verb norm 2 "is a shape of the model itself" model model/particles/s4_world.particles
refuse_verb norm 2 "needs a model folder and shapes" model
# Fits say what they are of, and are believed no more than that.
cp shapes/s4.ply guest.ply
"$apsm" fit model guest.ply -o fits -q >said 2>&1 || fail "fit: $(cat said)"
"$apsm" norm model fits -o n3 -q >said 2>&1 || fail "norm of a fit: $(cat said)"
grep -qF "guest: is the model's own s4" said || fail "a shape of the model is new: $(cat said)"
grep -q "\"note\": \".*is the model's own s4" n3/norm.json || fail "a shape of the model is new in norm.json"
"$apsm" measure model define.json fits -o m3 -q >said 2>&1 || fail "measure of a fit: $(tail -n 1 said)"
grep -qF "guest: is the model's own s4" said || fail "measure: a shape of the model is new: $(cat said)"
grep -q "\"note\": \".*is the model's own s4" m3/measurements.json || fail "a shape of the model is new in measurements.json"
head -n 1 m3/measurements_files.csv | grep -q ',middle,note$' || fail "no note in measurements_files.csv"
tail -n 1 m3/measurements_files.csv | grep -qF "is the model's own s4" || fail "a shape of the model is new in measurements_files.csv"
sed -i '0,/"verdict": "good"/s//"verdict": "needs review"/' fits/fit.json
"$apsm" predict model --of reach --subjects reach.csv -o p3 -q fits/particles/guest_world.particles >said 2>&1
grep -qF "guest: its fit needs review" said || fail "a doubtful fit is not told: $(cat said)"
"$apsm" predict model --of reach --subjects reach.csv -o p4 -q model/particles/s3_world.particles >said 2>&1
grep -q "\"note\": \"is the model's own s3" p4/reach_prediction.json || fail "particles of the model are new to it: $(cat said)"
grep -q "\"note\": \"its fit needs review: .*; is the model's own s4" p3/reach_prediction.json || fail "a doubtful fit is not in the prediction"
tail -n 1 p3/reach_prediction.csv | grep -qF "its fit needs review" || fail "a doubtful fit is not in the prediction's table"
sed -i '0,/"sha256": "...../s//"sha256": "00000/' fits/fit.json
refuse_verb norm 2 "fits to another model" model fits -o n4
refuse_verb predict 2 "fits to another model" model --of reach --subjects reach.csv -o p4 fits/particles/guest_world.particles
# However they are given: by their inner folder, or from inside it.
refuse_verb norm 2 "fits to another model" model fits/particles -o n4
refuse_verb norm 2 "fits to another model" model fits/particles/ -o n4
for given in . guest_world.particles; do
    (cd fits/particles && "$apsm" norm ../../model $given -o ../../n4 -q) >said 2>&1
    grep -qF "fits to another model" said || fail "fits to another model by $given: $(cat said)"
done
# A fit.json says nothing of files that lie elsewhere.
mkdir elsewhere && cp new_world.particles elsewhere
(cd fits && "$apsm" norm ../model ../elsewhere/new_world.particles -o ../n5 -q) >said 2>&1 ||
    fail "particles beside no fit.json: $(cat said)"
refuse_verb measure 2 "needs a model folder and a definition" model
sed 's/"volume"}/"volum"}/' define.json >bad.json
refuse_verb measure 1 "did you mean 'volume'" model bad.json
sed 's/\[0, 1\]/[0, 32]/' define.json >bad.json
refuse_verb measure 1 "the model has 0 to 31" model bad.json
sed 's/"area"}/"area", "whole": true}/' define.json >bad.json
refuse_verb measure 1 'means nothing for kind area' model bad.json
sed 's/\[0, 1, 0\]/[2, 0, 0]/' define.json >bad.json
refuse_verb measure 1 "lie on a line" model bad.json
for points in 1,2,2 1,1,2 3,4,5,5 4,4,5,6; do
    echo "{\"measurements\": [{\"name\": \"a\", \"kind\": \"angle\", \"points\": [$points]}]}" >bad.json
    refuse_verb measure 1 "two points of a side of the angle are one" model bad.json
done
[ -z "$(find . -name '*.tmp')" ] || fail "temporary files are left"
exit $failed
