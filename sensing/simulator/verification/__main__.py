"""``python -m sensing.simulator.verification``."""

import sys

from sensing.simulator.verification.report import main

sys.exit(main())
