#!/bin/sh
# KiCad with its Python module, for the test that runs KiCad's design rule check on the LED ring.
set -eu
/usr/bin/python3 -c "import pcbnew" 2>/dev/null && exit 0
exec sh "$(dirname "$0")/debian_packages.sh" KiCad kicad
