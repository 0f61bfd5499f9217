#!/bin/sh
# PrusaSlicer, for `make slice` and the tests that slice.
set -eu
for name in prusa-slicer PrusaSlicer prusa-slicer-console; do
    command -v "$name" >/dev/null && exit 0
done
exec sh "$(dirname "$0")/debian_packages.sh" PrusaSlicer prusa-slicer
