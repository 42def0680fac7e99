"""The IK daemon: wrist targets and measured joints in, joint positions out, over TCP JSON and Zenoh."""

import os

# The matrices are small: threads inside BLAS would only fight for the cores. Numpy reads this when it is first
# imported, so it is set before any module of this package is.
os.environ.setdefault("OMP_NUM_THREADS", "1")
