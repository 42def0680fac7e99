"""`python -m xr_client` is `ik-xr`."""

import sys

from xr_client.cli import main

sys.exit(main())
