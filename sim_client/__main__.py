"""`python -m sim_client` is `ik-sim`."""

import sys

from sim_client.cli import main

sys.exit(main())
