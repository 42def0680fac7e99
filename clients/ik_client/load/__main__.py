"""`python -m ik_client.load` is `ik-load`."""

import sys

from ik_client.load.cli import main

sys.exit(main())
