#!/bin/bash
# Programs of others: both examples, against an installation found by pkg-config, as C17 and as
# C++17, without a warning.  $1 is the build folder, $2 and $3 the compilers, $4 make_synthetic.
set -u
build=$(cd "$1" && pwd)
cc=$2
cxx=$3
synthetic=$(cd "$(dirname "$4")" && pwd)/$(basename "$4")
source=$PWD
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
failed=0
fail() {
    echo "FAILED: $*"
    failed=1
}

cmake --install "$build" --prefix "$folder/prefix" >"$folder/log" 2>&1 || { cat "$folder/log"; exit 1; }
pc=$(dirname "$(find "$folder/prefix" -name apsm.pc)")
export PKG_CONFIG_PATH=$pc
[ -e "$folder/prefix/include/apsm.h" ] || fail "no umbrella header"
ls "$folder"/prefix/include/apsm/*.h >/dev/null || fail "no headers"
read -ra flags < <(pkg-config --cflags --libs apsm)
rpath=-Wl,-rpath,$(pkg-config --variable=libdir apsm)
warn=(-Wall -Wextra -Wpedantic -Werror)

have_cxx=true
command -v "$cxx" >/dev/null || { have_cxx=false; echo "SKIPPED: no C++ compiler; C17 only"; }

cd "$folder" || exit 1
for name in memory folder; do
    "$cc" -std=c17 -D_POSIX_C_SOURCE=200809L "${warn[@]}" "$source/examples/$name.c" -o "$name.c17" \
        "${flags[@]}" "$rpath" -lm || fail "$name.c as C17"
    $have_cxx || continue
    "$cxx" -std=c++17 -x c++ "${warn[@]}" "$source/examples/$name.c" -o "$name.cpp17" \
        "${flags[@]}" "$rpath" -lm || fail "$name.c as C++17"
done
# Every header stands alone.
for header in "$folder"/prefix/include/apsm/*.h; do
    echo "#include <apsm/$(basename "$header")>" >alone.c
    "$cc" -std=c17 "${warn[@]}" -fsyntax-only alone.c "${flags[@]}" || fail "$(basename "$header") alone"
done

./memory.c17 >one 2>progress || fail "memory as C17: $(tail -1 progress)"
if $have_cxx; then
    ./memory.cpp17 >two 2>/dev/null || fail "memory as C++17"
    cmp -s one two || fail "C17 and C++17 differ"
fi
grep -q "^6 shapes, 64 particles, variances" one || fail "memory says $(head -1 one)"
[ "$(grep -c "surface distance" one)" -eq 6 ] || fail "memory: $(cat one)"
grep -q "fidelity" progress || fail "no progress"

mkdir shapes
for i in 0 1 2 3 4; do
    "$synthetic" bump shapes/s$i.ply index $i || fail "make_synthetic"
done
# With the kernels of BLAS that the program takes (docs/library.md) the library's bytes are the program's.
kernels=()
grep -qw avx2 /proc/cpuinfo 2>/dev/null && kernels=(OPENBLAS_CORETYPE=Haswell)
env "${kernels[@]}" ./folder.c17 model shapes >said 2>log || fail "folder: $(tail -1 log)"
"$build/apsm" run shapes -o program -J 64 --faces 2000 --quiet 2>log || fail "the program: $(tail -1 log)"
for kept in particles groomed model.json scores.csv certificate.json; do
    diff -rq "model/$kept" "program/$kept" || fail "the library's $kept are not the program's"
done
[ "$(cat said)" = "5 shapes, 64 particles, 4 modes" ] || fail "folder says $(cat said)"
[ -s mean.png ] || fail "no picture"
./folder.c17 nothing none >/dev/null 2>log && fail "an input that is missing"
grep -q "^folder: none" log || fail "the error says $(tail -1 log)"
exit $failed
