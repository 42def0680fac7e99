"""`python -m ik_service`: the command `ik-service`."""

import sys

from ik_service.cli import main

if __name__ == "__main__":
    sys.exit(main())
