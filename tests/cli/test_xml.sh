#!/bin/bash
# apsm VERB --xml keeps the rules of the Slicer Execution Model, and what it offers is taken.
# $1 is the program, $2 make_synthetic.
set -u
apsm=$1
synthetic=$2
rules=$(cd "$(dirname "$0")" && pwd)/check_xml.py
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
failed=0
command -v python3 >/dev/null || { echo "NOT TESTED: --xml; there is no Python"; exit 0; }

mkdir cohort
for i in 0 1 2; do "$synthetic" bump cohort/s$i.ply index $i count 3 level 2; done
verbs=$("$apsm" --help | awk '/^Verbs/ { on = 1; next } on && /^$/ { exit } on && /^  [a-z]/ { print $1 }')
for verb in $verbs; do
    "$apsm" "$verb" --xml >"$verb.xml" || { echo "FAILED: $verb --xml"; failed=1; }
done
python3 "$rules" *.xml || failed=1

# A link called apsm-run is the module; it takes all that its description offers, at the defaults.
ln -s "$apsm" apsm-run
./apsm-run --xml | cmp -s - run.xml || { echo "FAILED: apsm-run --xml"; failed=1; }
mapfile -t words < <(python3 "$rules" --defaults run.xml)
[ ${#words[@]} -gt 40 ] || { echo "FAILED: only ${#words[@]} words of defaults"; failed=1; }
./apsm-run "${words[@]}" --dry-run -o model cohort >said 2>&1 || { echo "FAILED: the defaults of run.xml: $(cat said)"; failed=1; }
"$apsm" --xml >said 2>&1 && { echo "FAILED: --xml without a verb"; failed=1; }
exit $failed
