#!/bin/sh
# Debian packages where we may install them, else the command to run: sh debian_packages.sh "what for" package...
# In the environment: APT_OPTIONS goes to apt-get, AS_ROOT is the command to name instead of apt-get's.
set -eu
what="$1"
shift

command="apt-get${APT_OPTIONS:+ $APT_OPTIONS} install -y --no-install-recommends $*"
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    may=""
elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
    may="sudo"
else
    echo "$what: missing; run: sudo ${AS_ROOT:-$command}" >&2
    exit 2
fi
echo "installing $what (once)" >&2
$may apt-get ${APT_OPTIONS:-} update -q >/dev/null
$may env DEBIAN_FRONTEND=noninteractive $command >/dev/null
