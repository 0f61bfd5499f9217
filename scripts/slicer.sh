#!/bin/sh
# PrusaSlicer, for `make slice` and the tests that slice. Installed where we may, else named.
set -eu
for name in prusa-slicer PrusaSlicer prusa-slicer-console; do
    command -v "$name" >/dev/null && exit 0
done

command="apt-get install -y --no-install-recommends prusa-slicer"
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    echo "installing PrusaSlicer (once)" >&2
    apt-get update -q >/dev/null && DEBIAN_FRONTEND=noninteractive $command >/dev/null
elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
    echo "installing PrusaSlicer (once)" >&2
    sudo apt-get update -q >/dev/null && sudo DEBIAN_FRONTEND=noninteractive $command >/dev/null
else
    echo "PrusaSlicer is missing; run: sudo $command" >&2
    exit 2
fi
