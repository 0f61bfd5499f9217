#!/bin/sh
# System libraries: three that CAD kernel and pictures link to, and one of pymeshlab (a small Debian 13 has none).
set -eu
PATH="$PATH:/usr/sbin:/sbin" # where ldconfig is, which Debian's own setting leaves out for all but root
missing=""
for pair in libGL.so.1:libgl1 libEGL.so.1:libegl1 libOpenGL.so.0:libopengl0 libcom_err.so.2:libcom-err2; do
    ldconfig -p | grep -q "${pair%%:*}" || missing="$missing ${pair##*:}"
done
[ -z "$missing" ] || exec sh "$(dirname "$0")/debian_packages.sh" "system libraries" $missing
