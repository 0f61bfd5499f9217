#!/bin/sh
# The three system libraries that CAD kernel and pictures link to. Installed where we may, else named.
set -eu
missing=""
for pair in libGL.so.1:libgl1 libEGL.so.1:libegl1 libOpenGL.so.0:libopengl0; do
    ldconfig -p | grep -q "${pair%%:*}" || missing="$missing ${pair##*:}"
done
[ -z "$missing" ] && exit 0

command="apt-get install -y --no-install-recommends$missing"
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    apt-get update -q >/dev/null && DEBIAN_FRONTEND=noninteractive $command >/dev/null
elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
    sudo apt-get update -q >/dev/null && sudo DEBIAN_FRONTEND=noninteractive $command >/dev/null
else
    echo "missing system libraries:$missing; run: sudo $command" >&2
    exit 2
fi
