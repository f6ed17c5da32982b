#!/bin/sh
# The committed viewer is, byte for byte, what its sources build: test_bundle.sh FOLDER.  Exit status
# 77, skipped, without npm or its registry.
set -u
folder=$1
if ! command -v npm >/dev/null; then
    echo "THE VIEWER IS NOT REBUILT: there is no npm" >&2
    exit 77
fi
rm -rf "$folder" && mkdir -p "$folder" || exit 1
cp -r report/viewer/package.json report/viewer/package-lock.json report/viewer/build.mjs \
    report/viewer/src "$folder" || exit 1
cd "$folder" || exit 1
if ! npm ci --silent --no-audit --no-fund; then
    echo "THE VIEWER IS NOT REBUILT: npm cannot fetch three.js and esbuild" >&2
    exit 77
fi
npm run --silent build || exit 1
cd - >/dev/null || exit 1
cmp "$folder/dist/viewer.html" report/viewer/dist/viewer.html || {
    echo "report/viewer/dist is not what its sources build; run make viewer" >&2
    exit 1
}
