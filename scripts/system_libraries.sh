#!/bin/sh
# The three system libraries that CAD kernel and pictures link to.
set -eu
PATH="$PATH:/usr/sbin:/sbin" # where ldconfig is, which Debian's own setting leaves out for all but root
missing=""
for pair in libGL.so.1:libgl1 libEGL.so.1:libegl1 libOpenGL.so.0:libopengl0; do
    ldconfig -p | grep -q "${pair%%:*}" || missing="$missing ${pair##*:}"
done
[ -z "$missing" ] || exec sh "$(dirname "$0")/debian_packages.sh" "system libraries" $missing
