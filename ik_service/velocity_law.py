"""Rate control of both arms as one CasADi function, from a request's numbers to the answer's.

    request, options -> answer, report

Each arm's twists come to joint velocities by `resolved_rate`. Of those the farthest motion is taken that approaches no
bound too fast (`dampers`): joint limits, the box for the wrist, singular postures, the body. Where that is less than
what was asked for, the whole arm slows down uniformly, so the hand keeps its direction. A motion along the free
direction helps first.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np

from ik_proto import LimitedBy
from ik_service.chains import ArmChain
from ik_service.dampers import ROUNDING, Farthest, damper, farthest, held_back
from ik_service.layout import AVOID, OFF, JointCounts, mount
from ik_service.newton import when
from ik_service.pair_rows import MOTIONS, pair_rows
from ik_service.proximity import Proximity
from ik_service.resolved_rate import SETTINGS, Resolved, q_ahead, resolved_rate
from ik_service.robot import Robot

FREE = 1e6
"""Speed that bounds nothing."""

SLOW = 1e-9
"""Joint speed that counts as none [rad/s]."""

BRAKING = 0.75
"""Share of the largest acceleration that a joint limit may ask for."""

ARM_REPORT = (
    "manipulability",
    "damping",
    "slowed",
    "damped",
    "share",
    "place",
    "hurried",
    "ramp",
    "held_back",
    "apart",
)
"""What is said of each arm, left then right: manipulability [m^3] and damping [m]; what the largest joint speed left of
the twist, and what damping left of that; the share that no bound held up, and the row of the one that did (see
`row_names`); the scale for the sake of the largest speed once more, what of the change of velocity the largest
acceleration allowed, and the scales for the sake of a near bound and of the other arm."""

REPORT = (*(f"{key}_{side}" for side in ("left", "right") for key in ARM_REPORT), "clearance", "nearest", "between")
"""Then clearance [m] and place of the nearest pair of capsules, and the place of the pair that slows both arms."""


class VelocityLayout(JointCounts):
    """Where things are in the vectors of the rate control."""

    @property
    def request(self) -> dict[str, slice]:
        """Parts of the request: joint positions and velocities, and the twists left and right."""
        return _slices({"q": self.nq, "dq": self.nq, "twists": 12})

    @property
    def options(self) -> dict[str, slice]:
        """Parts of the options: `SETTINGS` with what is held of each arm, corners of the boxes, and so on."""
        sizes = {"waist": self.waist, **dict.fromkeys(SETTINGS, 1), "held": 2, "bounds": 12}
        return _slices(sizes | {"max_acceleration": 1, "period": 1, "collision": 1, "posture": self.nq})

    @property
    def answer(self) -> dict[str, slice]:
        """Parts of the answer: joint velocities, and the twists they come to."""
        return _slices({"dq": self.nq, "twists": 12})


def row_names(robot: Robot, arm: int) -> list[tuple[LimitedBy, str | None]]:
    """Name the rows of an arm.

    Args:
        robot: The robot.
        arm: 0 for the left arm, 1 for the right.

    Returns:
        What kind of bound each is, and the joint whose limit it is.
    """
    joints: list[tuple[LimitedBy, str | None]] = [("joint", name) for name in robot.arms[arm].joint_names]
    box: list[tuple[LimitedBy, str | None]] = [("bounds", None)] * 6
    pairs: list[tuple[LimitedBy, str | None]] = [("collision", None)] * len(_own_pairs(robot, arm))
    return [*joints, *joints, *box, ("singularity", None), *pairs]


def velocity_law(robot: Robot) -> ca.Function:
    """Build the rate control of a robot.

    Args:
        robot: The robot.

    Returns:
        Function (request, options) -> (answer, report) of vectors as in `VelocityLayout` and `REPORT`.
    """
    layout, nq = VelocityLayout.of(robot), robot.nq
    parts = layout.request, layout.options
    request, options = (ca.MX.sym(key, _length(part)) for key, part in zip(("request", "options"), parts, strict=True))
    given = {key: vector[s] for vector, part in zip((request, options), parts, strict=True) for key, s in part.items()}
    R, p, base_ends, _ = mount(robot)(given["waist"])
    halves = (slice(0, robot.arms[0].n), slice(robot.arms[0].n, nq))
    resolved = []
    for i, (arm, half) in enumerate(zip(robot.arms, halves, strict=True)):
        settings = [given[key] if key != "held" else given["held"][i] for key in SETTINGS]
        twist = given["twists"][6 * i : 6 * i + 6]
        q = q_ahead(arm)(given["q"][half], given["dq"][half], given["period"], given["held"][i], given["fixed"])
        fields = resolved_rate(arm, robot.waist)(q, twist, ca.vertcat(*settings), given["posture"][half], R, p)
        resolved.append(Resolved(*fields))
    body = _Body.of(robot, given["q"], base_ends, given["collision"])
    motions = ca.horzcat(
        *(ca.vertcat(*(getattr(arm, key) for arm in resolved)) for key in ("task", "free")), given["dq"]
    )
    moved, reports = [], []
    for i, (arm, half) in enumerate(zip(robot.arms, halves, strict=True)):
        pairs = _own_pairs(robot, i)
        dq, report = _arm_motion(arm, len(pairs))(
            *vars(resolved[i]).values(),
            given["q"][half],
            given["dq"][half],
            given["max_speed"],
            given["max_acceleration"],
            given["period"],
            given["bounds"][6 * i : 6 * i + 6],
            body.closing(pairs, motions, f"{arm.side}_closing"),
            body.most(pairs),
        )
        moved.append(dq)
        reports.append(report)
    apart, between = body.apart(*moved)
    moved = [apart[i] * dq for i, dq in enumerate(moved)]
    twists = [arm.jacobian @ dq for arm, dq in zip(resolved, moved, strict=True)]
    report = ca.vertcat(*(part for i in range(2) for part in (reports[i], apart[i])), *body.nearest, between)
    return ca.Function("velocity", [request, options], [ca.vertcat(*moved, *twists), report])


@dataclass(frozen=True)
class _Body:
    """The robot's capsules in one posture.

    Attributes:
        robot: The robot.
        proximity: Its collision functions; None without pairs to check.
        avoid: Whether to keep clear.
        d: Clearance of every pair [m]; far where nothing is measured.
        shape: Ends of capsules and joint lines.
        nearest: Clearance, and place of the nearest pair.
    """

    robot: Robot
    proximity: Proximity | None
    avoid: ca.MX
    d: ca.MX
    shape: list[ca.MX]
    nearest: list[ca.MX]

    @classmethod
    def of(cls, robot: Robot, q: ca.MX, base_ends: ca.MX, collision: ca.MX) -> "_Body":
        if not robot.collision.pairs:
            return cls(robot, None, ca.MX(0), ca.MX.zeros(0), [], [ca.MX.inf(), ca.MX(-1)])
        proximity, q_sym = Proximity.of(robot), ca.MX.sym("q", robot.nq)
        ends_sym = ca.MX.sym("base_ends", base_ends.sparsity())
        ends, lines = proximity.shape(q_sym, ends_sym)
        d = proximity.clearances(ends)
        outputs = [d, ends, lines, *proximity.nearest(d)]
        old = [ca.MX.sym(f"old_{i}", output.sparsity()) for i, output in enumerate(outputs)]
        measure = when(ca.Function("measured", [*old, q_sym, ends_sym], outputs))
        unmeasured = [FREE * ca.MX.ones(d.shape), *(ca.MX.zeros(part.shape) for part in (ends, lines)), ca.MX.inf(), -1]
        d, ends, lines, clearance, place = measure(collision > OFF, *unmeasured, q, base_ends)
        return cls(robot, proximity, collision == AVOID, d, [ends, lines], [clearance, place])

    def closing(self, pairs: range, motions: ca.MX, name: str) -> ca.MX:
        """How fast motions close the gaps of some pairs [m/s], shape (MOTIONS, pairs)."""
        nothing = ca.MX.zeros(MOTIONS, len(pairs))
        if self.proximity is None or not pairs:
            return nothing
        rows = pair_rows(self.robot, self.proximity, pairs, name)
        inputs = [ca.MX.sym(rows.name_in(i), rows.sparsity_in(i)) for i in range(rows.n_in())]
        old = ca.MX.sym("old", nothing.shape)
        guarded = when(ca.Function(f"{name}_looked_at", [old, *inputs], [rows(*inputs)]))
        return guarded(self.avoid, nothing, self.d, *self.shape, motions)

    def most(self, pairs: range) -> ca.MX:
        """How fast the gaps of some pairs may close [m/s]."""
        d = ca.SX.sym("d", len(pairs))
        most = ca.Function(
            "most", [d], [ca.vertcat(*(damper(x - self.robot.collision.margin) for x in ca.vertsplit(d)))]
        )
        return most(self.d[pairs.start : pairs.stop]) if pairs else ca.MX.zeros(0)

    def apart(self, left: ca.MX, right: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Scales of the arms that let them approach each other no faster than they may, and the place of the pair."""
        pairs = self.robot.collision.across
        if self.proximity is None or not pairs:
            return ca.MX.ones(2), ca.MX(-1)
        motions = ca.blockcat([[left, ca.MX.zeros(left.shape)], [ca.MX.zeros(right.shape), right]])
        closing = self.closing(pairs, ca.horzcat(motions, ca.MX.zeros(self.robot.nq)), "across")
        scales, asked = _apart(len(pairs))(closing, self.most(pairs))
        return scales, pairs.start + ca.find(asked <= ca.mmin(asked))


def _own_pairs(robot: Robot, arm: int) -> range:
    """Places of the pairs that an arm alone can change."""
    return (robot.collision.left, robot.collision.right)[arm]


def _arm_motion(chain: ArmChain, pairs: int) -> ca.Function:
    """(fields of `Resolved`, q, dq, largest speed and acceleration, period, box, rows of pairs) -> (dq, report)."""
    n = chain.n
    rows = _rows(chain, pairs)
    search = farthest(rows.size1_out(0))
    shapes = resolved_shapes(n)
    resolved = Resolved(**{key: ca.MX.sym(key, *shape) for key, shape in shapes.items()})
    q, dq = ca.MX.sym("q", n), ca.MX.sym("dq", n)
    max_speed, max_acceleration, period = (ca.MX.sym(key) for key in ("max_speed", "max_acceleration", "period"))
    bounds, closing = ca.MX.sym("bounds", 6), ca.MX.sym("closing", MOTIONS, pairs)
    most_closing = ca.MX.sym("most_closing", pairs)
    task, free, last, most = rows(*vars(resolved).values(), q, dq, max_acceleration, bounds, closing, most_closing)
    wanted = resolved.most * resolved.task
    task *= resolved.most
    found = Farthest(*search(task, free, most, resolved.wish, resolved.most_free, ca.norm_2(wanted)))
    change = max_acceleration * period
    moved = _finish(n, rows.size1_out(0))(
        wanted, resolved.free, found.share, found.free, dq, max_speed, change, task, free, last, most
    )
    report = ca.vertcat(
        resolved.manipulability,
        resolved.damping,
        resolved.slowed,
        resolved.damped * resolved.most,
        found.share,
        found.place,
        *moved[1:],
    )
    inputs = [*vars(resolved).values(), q, dq, max_speed, max_acceleration, period, bounds, closing, most_closing]
    return ca.Function(f"{chain.side}_motion", inputs, [moved[0], report])


def resolved_shapes(n: int) -> dict[str, tuple[int, int]]:
    """Shapes of the fields of `Resolved` of an arm of n joints."""
    shapes = dict.fromkeys(Resolved.__dataclass_fields__, (1, 1))
    shapes |= dict.fromkeys(("task", "free", "worth_gradient"), (n, 1))
    return shapes | {"position": (3, 1), "jacobian": (6, n), "jacobian_base": (3, n)}


def _rows(chain: ArmChain, pairs: int) -> ca.Function:
    """Put the bounds of an arm together: (...) -> how fast task, free motion and dq approach each, and the most."""
    n = chain.n
    resolved = Resolved(**{key: ca.SX.sym(key, *shape) for key, shape in resolved_shapes(n).items()})
    q, dq, max_acceleration = ca.SX.sym("q", n), ca.SX.sym("dq", n), ca.SX.sym("max_acceleration")
    bounds, closing, most_closing = ca.SX.sym("bounds", 6), ca.SX.sym("closing", MOTIONS, pairs), ca.SX.sym("m", pairs)
    braking = BRAKING * max_acceleration
    room = ca.vertsplit(ca.vertcat(chain.upper - q, q - chain.lower))
    box = ca.vertsplit(ca.vertcat(bounds[3:] - resolved.position, resolved.position - bounds[:3]))
    # A singular posture is not to be come to, but inside it, where direction and damping slow the hand, the arm must be
    # free to go through: it may have to, to get out.
    most = [damper(d, braking) for d in room] + [damper(d) for d in (*box, ca.fabs(resolved.worth))]
    approaches = []
    for k, motion in enumerate((resolved.task, resolved.free, dq)):
        moved = resolved.jacobian_base @ motion
        worse = -(resolved.worth_gradient.T @ motion)
        approaches.append(ca.vertcat(motion, -motion, moved, -moved, worse, closing[k, :].T))
    inputs = [*vars(resolved).values(), q, dq, max_acceleration, bounds, closing, most_closing]
    return ca.Function(f"{chain.side}_rows", inputs, [*approaches, ca.vertcat(*most, most_closing)])


@cache
def _finish(n: int, rows: int) -> ca.Function:
    """From the farthest motion to the answer.

    (task, free, share, free speed, dq, largest speed, largest change, rows of task, free and dq, most) -> (dq, scale
    for the sake of the largest speed, share of the change of velocity, scale for the sake of a near bound).
    """
    task, free, last = (ca.SX.sym(key, n) for key in ("task", "free", "last"))
    share, along, max_speed, change = (ca.SX.sym(key) for key in ("share", "along", "max_speed", "change"))
    approach = [ca.SX.sym(key, rows) for key in ("task_rows", "free_rows", "last_rows")]
    most = ca.SX.sym("most", rows)
    wanted = share * task + along * free
    slowed = ca.fmin(1.0, max_speed / ca.fmax(ca.norm_inf(wanted), SLOW))
    wanted *= slowed
    ramp = ca.fmin(1.0, change / ca.fmax(ca.norm_inf(wanted - last), SLOW))
    approaching = ramp * slowed * (share * approach[0] + along * approach[1]) + (1.0 - ramp) * approach[2]
    # Near a singular posture nothing breaks; what the ramp carries there is not stopped for it.
    hard = [i for i in range(rows) if i != _singularity(n)]
    back = held_back(approaching[hard], most[hard])
    dq = back * (last + ramp * (wanted - last))
    inputs = [task, free, share, along, last, max_speed, change, *approach, most]
    return ca.Function("finish", inputs, [dq, slowed, ramp, back], {"cse": True})


def _singularity(n: int) -> int:
    """Row of the singularity, of an arm of n joints: after the joints' limits and the box."""
    return 2 * n + 6


def _apart(pairs: int) -> ca.Function:
    """(closing of left, right and nothing; most) -> (scales of left and right, scale that each pair asks for).

    What one arm opens is credited to the other, but only as much of it as is certain: what is left of that arm's motion
    when neither credits the other.
    """
    closing, most = ca.SX.sym("closing", MOTIONS, pairs), ca.SX.sym("most", pairs)
    certain, _ = _scales(closing, most, [ca.SX(0), ca.SX(0)])
    scales, asked = _scales(closing, most, certain)
    return ca.Function("apart", [closing, most], [ca.vertcat(*scales), asked], {"cse": True})


def _scales(closing: ca.SX, most: ca.SX, certain: Sequence[ca.SX]) -> tuple[list[ca.SX], ca.SX]:
    scales, asked = [ca.SX(1), ca.SX(1)], []
    for k in range(most.numel()):
        left, right = closing[0, k], closing[1, k]
        opened = certain[0] * ca.fmin(left, 0.0) + certain[1] * ca.fmin(right, 0.0)
        allowed = most[k] - opened + ROUNDING
        asked.append(allowed / ca.fmax(ca.fmax(left, 0.0) + ca.fmax(right, 0.0), allowed))
        scales = [ca.fmin(scale, asked[k] + (one <= 0.0)) for one, scale in zip((left, right), scales, strict=True)]
    return scales, ca.vertcat(*asked)


def _slices(sizes: dict[str, int]) -> dict[str, slice]:
    ends = np.cumsum(list(sizes.values())).tolist()
    return {key: slice(end - size, end) for (key, size), end in zip(sizes.items(), ends, strict=True)}


def _length(parts: dict[str, slice]) -> int:
    return max(part.stop for part in parts.values())
