"""DepthAI, told to keep its log off standard output: what matters is said by who calls it, in one line."""

import os

# It looks at this while it is imported. Who wants its log sets the variable.
os.environ.setdefault("DEPTHAI_LEVEL", "off")

import depthai

__all__ = ["depthai"]
