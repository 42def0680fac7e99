"""Numbers both ends agree on."""

PROTOCOL_VERSION = 1

MAX_FRAME_BYTES = 2 * 1024 * 1024
"""Largest request or reply body [bytes]. A solve request takes about 1.3 kB as JSON, 0.6 kB as MessagePack; the largest
batch with every optional field, 1.6 MB and 0.6 MB."""

MAX_BATCH = 1024
"""Most problems in one `solve_batch`."""

MAX_POSTURES = 128
"""Most postures in one `clearance`."""

MAX_STARTS = 256
"""Most starts an arm may be given in mode `reach`."""

DEFAULT_STARTS = 128
"""Starts an arm is given in mode `reach` where a request does not say."""

DEFAULT_DAMPING = 0.05
"""Damping of a `velocity` where a request does not say."""

DEFAULT_SPEED = 1.5
"""Largest speed of a joint in a `velocity` where a request does not say [rad/s]."""

DEFAULT_ACCELERATION = 12.0
"""Largest acceleration of a joint in a `velocity` where a request does not say [rad/s^2]: full speed in an eighth of a
second."""

DEFAULT_PERIOD = 0.02
"""Time from one `velocity` of a control loop to the next where a request does not say [s]."""

DEFAULT_POSTURE_GAIN = 0.5
"""Share of the way to the posture that is made in a second where a `velocity` does not say [1/s]."""

SINGULAR_TWIST = 5e-4
"""Manipulability of a whole twist below which `velocity` counts a posture as singular [m^3]. The G1's arm comes below
it with the elbow 0.04 rad from straight; half of its postures are beyond six times that."""

SINGULAR_LINEAR = 1e-3
"""The same of the linear part alone, where the orientation is left free [m^3]."""

MAX_TWIST = 100.0
"""Largest norm of a twist, in metres and radians a second."""

MAX_ID = 2**53 - 1
"""Largest request id: the integers a JSON number carries exactly (RFC 8259, section 6)."""

MAX_STREAM_CHARACTERS = 64
"""Longest name of a stream of requests."""

MAX_BUDGET_MS = 10_000.0
"""Longest time an answer may be worth having [ms]."""

MAX_ABS_POSITION = 100.0
"""Largest coordinate of a wrist target [m]. Anything beyond is a unit mistake, not a target."""

MAX_ABS_JOINT = 100.0
"""Largest norm of the joint positions [rad] or velocities [rad/s] a request may carry."""

ROTATION_TOLERANCE = 1e-3
"""Largest Frobenius norm of R^T R - I that still counts as a rotation; within it, R is projected onto SO(3).
Larger than any float32 round trip leaves, small enough that a shear or a scale is refused."""

MIN_ELBOW_LENGTH = 1e-6
"""Shortest vector from shoulder to elbow that still has a direction; whatever its unit, a shorter one is noise."""

OPENWBT_MARK = "current_lr_arm_q"
"""The field by which a request in OpenWBT's form is recognised."""

DEFAULT_TCP = "127.0.0.1:12345"
"""Where the TCP JSON endpoint listens unless told otherwise [host:port]; the port of OpenWBT's `ik_server`."""

DEFAULT_ZENOH = "tcp/127.0.0.1:7447"
"""Where the Zenoh endpoint listens unless told otherwise [Zenoh locator]."""
