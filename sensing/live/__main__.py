"""``python -m sensing.live``."""

import sys

from sensing.live.cli import main

if __name__ == "__main__":
    sys.exit(main())
