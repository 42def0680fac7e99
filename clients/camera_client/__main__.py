"""`python -m camera_client` is `ik-camera`."""

import sys

from camera_client.cli import main

sys.exit(main())
