# What the tests of the command line begin with; sourced with the program as $1 and make_synthetic as $2.
# Leaves them in an empty folder that goes at the end, with: fail WORDS, expect CODE WORDS ARGUMENT...
# shellcheck shell=bash disable=SC2034 # the variables are the tests'
set -u
apsm=$1
synthetic=${2:-}
here=$(cd "$(dirname "$0")" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
failed=0
limit=60                       # seconds that a call of expect may take,
slower=${APSM_TESTS_SLOWER:-1} # times this: what sanitizers watch takes longer

fail() {
    echo "FAILED: $*"
    failed=1
}

# Exit code, and words in what the program says (both streams, in the file said).
expect() {
    local code=$1 words=$2
    shift 2
    timeout -k 5 $((limit * slower)) "$apsm" "$@" >said 2>&1 </dev/null
    local got=$?
    if [ $got -ne "$code" ]; then
        fail "apsm $*: exit code $got, not $code: $(tail -n 3 said)"
    elif [ -n "$words" ] && ! grep -qF -- "$words" said; then
        fail "apsm $*: does not say '$words': $(tail -n 3 said)"
    fi
}

# seal FILE: the last key of a manifest is the sum of all before it.
seal() {
    sed -i '/^    "sha256": /,$d' "$1"
    printf '    ' >>"$1"
    local sum
    sum=$(sha256sum "$1" | cut -d' ' -f1)
    printf '"sha256": "%s"\n}\n' "$sum" >>"$1"
}
