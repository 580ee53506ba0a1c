"""``python -m fpk_rocking``: the command line."""

import sys

from fpk_rocking.cli import main

if __name__ == "__main__":
    sys.exit(main())
