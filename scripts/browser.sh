#!/bin/sh
# Chromium, for the tests that open the pages in a browser.
set -eu
for name in chromium chromium-browser google-chrome; do
    command -v "$name" >/dev/null && exit 0
done
exec sh "$(dirname "$0")/debian_packages.sh" Chromium chromium
