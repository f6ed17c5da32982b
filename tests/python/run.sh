#!/bin/sh
# Builds the Python module against an installation and tests it.  $1 build folder, $2 compiler, $3
# program, $4 make_synthetic.  77: there is no Python to build for.
set -u
build=$(cd "$1" && pwd) cc=$2
include=
for python in python3 /usr/bin/python3; do
    include=$("$python" -c 'import sysconfig, os, sys
path = sysconfig.get_path("include")
sys.exit(0 if sys.version_info >= (3, 11) and os.path.exists(path + "/Python.h") and not print(path) else 1)' 2>/dev/null) && break
done
if [ -z "$include" ]; then
    echo "SKIPPED: no Python 3.11 or later with its headers (python3-dev)"
    exit 77
fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cmake --install "$build" --prefix "$folder/prefix" >"$folder/log" 2>&1 || { cat "$folder/log"; exit 1; }
PKG_CONFIG_PATH=$(dirname "$(find "$folder/prefix" -name apsm.pc)")
export PKG_CONFIG_PATH
cp -r python/apsm "$folder/apsm"
# shellcheck disable=SC2046
"$cc" -std=c17 -O2 -Wall -Wextra -Werror -shared -fPIC -I"$include" python/_*.c -o "$folder/apsm/_apsm.abi3.so" \
    $(pkg-config --cflags --libs apsm) -Wl,-rpath,"$(pkg-config --variable=libdir apsm)" || exit 1
# The example, on a small cohort.
mkdir "$folder/cohort"
for i in 1 2 3 4 5 6 7 8 9; do
    side=R
    [ $((i % 2)) -eq 0 ] && side=L
    "$4" ellipsoid "$folder/cohort/bone_${side}_$i.ply" level 3 index $((i * 5 % 9)) count 9 wobble 0.02 seed $i || exit 1
done
TMPDIR=$folder PYTHONPATH=$folder "$python" examples/cohort.py "$folder/cohort" 32 >"$folder/said" 2>&1 &&
    grep -q '^side on form: p = ' "$folder/said" && grep -q '^left minus right: largest at particle' "$folder/said" &&
    grep -q '^<apsm.Fit: ' "$folder/said" && [ -s "$folder"/apsm-*/tables/modes.csv ] || {
    cat "$folder/said"
    echo "FAILED: examples/cohort.py"
    exit 1
}
APSM_PROGRAM=$3 APSM_SYNTHETIC=$4 PYTHONPATH=$folder "$python" -W ignore tests/python/test_apsm.py
