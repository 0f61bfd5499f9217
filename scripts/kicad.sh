#!/bin/sh
# KiCad 8 or later with kicad-cli, for the tests that open the LED ring's project in KiCad.
set -eu
here="$(dirname "$0")"

version="$(kicad-cli version 2>/dev/null || echo 0)"
[ "${version%%.*}" -ge 8 ] && exit 0
release="$(. /etc/os-release && echo "${VERSION_CODENAME:-}")"
[ "$release" = bookworm ] || exec sh "$here/debian_packages.sh" KiCad kicad

# Debian 12 has KiCad 6, its backports have a later one. Lists of our own: the machine's sources stay as they are.
own="$(mktemp -d)"
trap 'rm -rf "$own"' EXIT
mkdir -p "$own/lists/partial" "$own/cache/archives/partial" "$own/sources"
cp -r /etc/apt/sources.list.d/. "$own/sources"
mirror="$(apt-get --print-uris update | sed -n "s|^'\(.*\)dists/$release/InRelease'.*|\1|p" | head -n 1)"
echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $mirror $release-backports main" \
    >"$own/sources/backports.list"
chmod -R a+rX "$own"
APT_OPTIONS="-o Dir::Etc::sourceparts=$own/sources -o Dir::State::lists=$own/lists -o Dir::Cache=$own/cache"
export APT_OPTIONS="$APT_OPTIONS -t $release-backports" AS_ROOT="sh $0"
sh "$here/debian_packages.sh" KiCad kicad
