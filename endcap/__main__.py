"""``python -m endcap``, the same as the command ``endcap``."""

import sys

from endcap.command import main

if __name__ == "__main__":
    sys.exit(main())
