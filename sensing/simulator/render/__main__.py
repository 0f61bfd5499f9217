"""``python -m sensing.simulator.render``."""

import sys

from sensing.simulator.render.cli import main

sys.exit(main())
