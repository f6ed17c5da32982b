#!/bin/bash
# The program from outside: exit codes, where its words go, and that no mistake in the command line
# leaves anything behind.  $1 is the program.
set -u
apsm=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
failed=0

# expect CODE WORDS ARGUMENT...: exit code, and words in what it says (both streams).
expect() {
    local code=$1 words=$2
    shift 2
    local said
    said=$("$apsm" "$@" 2>&1 </dev/null)
    local got=$?
    if [ $got -ne "$code" ]; then
        echo "apsm $*: exit code $got, not $code: $said"
        failed=1
    elif ! grep -qF -- "$words" <<<"$said"; then
        echo "apsm $*: does not say '$words': $said"
        failed=1
    fi
}

expect 0 "apsm 0." --version
expect 0 "Usage: apsm VERB" --help
for verb in run groom initialize optimize evaluate report render check convert verify info fit export exclude add; do
    expect 0 "Usage: apsm $verb" $verb --help
    expect 0 "Usage: apsm $verb" help $verb
    expect 2 "the nearest is --help" $verb --hel
    "$apsm" $verb --help | grep -q "^  apsm $verb " || { echo "$verb --help has no example"; failed=1; }
done
expect 2 "apsm --help"
expect 2 "the nearest is 'optimize'" optimise
expect 2 "the nearest is --particles" run x -o "$folder/m" --partcles 3
expect 2 "contradict" run x -o "$folder/m" --resume --overwrite
expect 2 "particles = 2" run x -o "$folder/m" -J 2
expect 2 "give the error to meet" run "$folder" -o "$folder/m" --particles auto
expect 2 "error = 3: is met by particles = auto only" run "$folder" -o "$folder/m" --error 3mm
expect 2 "option error = 3cm" run "$folder" -o "$folder/m" --particles auto --error 3cm
expect 2 "fidelity above 0" run "$folder" -o "$folder/m" --particles auto --error 3 --fidelity 0
expect 2 "needs method = adaptive" run "$folder" -o "$folder/m" --particles auto --error 3 --method psm
expect 2 "alpha is given twice" run x -o "$folder/m" --alpha 1 --set alpha=2
expect 1 "nowhere: no such file" run "$folder/nowhere" -o "$folder/m"
expect 1 "nowhere: no such file" info "$folder/nowhere"
expect 2 "convert needs an output" convert x.csv
expect 2 "convert needs particles" convert -o "$folder/m"
expect 2 "--to does not belong to 'run'" run x -o "$folder/m" --to csv
printf '1 2 3\n4 5 6.5\n' >"$folder/two.lpts"
expect 2 "--to xyz: give particles" convert "$folder/two.lpts" -o "$folder/m" --to xyz
expect 2 "not a format of particles" convert "$folder/two.lpts" -o "$folder/m"
expect 2 "is an input" convert "$folder/two.lpts" -o "$folder" --to lpts
expect 2 "two inputs" convert "$folder/two.lpts" "$folder/two.lpts" -o "$folder/m" --to csv
expect 2 "cannot hold 2 shapes" convert "$folder/two.lpts" "$folder/two.lpts" -o "$folder/m.csv"
[ -e "$folder/m" ] && echo "a mistake made a folder" && failed=1

# Anyone's particle files: shapes on a line have one mode, which tells everything.
for x in 0 1 2 3; do
    printf '%s 0 0\n0 %s 1\n0 1 0\n2 2 2\n' $x $x >"$folder/$x.particles"
done
expect 0 "4 shapes, 4 particles, definition standard" evaluate "$folder"/?.particles
expect 0 "1 1 " evaluate "$folder"/?.particles --definition paper --specificity-samples 10
expect 2 "specificity_modes" evaluate "$folder"/?.particles --specificity-modes -1
expect 2 "give 3 at least" evaluate "$folder"/[01].particles
expect 2 "give a mesh for each" evaluate "$folder"/?.particles "$0"
expect 2 "leave out -o" evaluate "$folder"/?.particles -o "$folder/m"
echo "0 0 0" >>"$folder/3.particles"
expect 1 "3.particles" evaluate "$folder"/?.particles
[ -e "$folder/m" ] && echo "evaluate on files made a folder" && failed=1

# Help goes to standard output, mistakes to standard error.
[ -n "$("$apsm" --help 2>/dev/null)" ] || { echo "no help on standard output"; failed=1; }
[ -z "$("$apsm" nonsense 2>/dev/null)" ] || { echo "a mistake on standard output"; failed=1; }

# Output that is lost is a failure.
if [ -e /dev/full ]; then
    "$apsm" --help >/dev/full 2>/dev/null && { echo "a full disk passed for success"; failed=1; }
fi
exit $failed
