"""`python -m pipeline` is the command `lightsphere`."""

import sys

from .cli import main

if __name__ == "__main__":
    sys.exit(main())
