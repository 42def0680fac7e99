"""`python -m gamepad_client` is `ik-gamepad`."""

import sys

from gamepad_client.cli import main

sys.exit(main())
