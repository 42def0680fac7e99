"""Self-collision: what answers keep, pair by pair, measured apart from the solver.

A pair of capsules may never come nearer than the margin; one that already is nearer may only open.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from benchmarks.limits.geometry import wrists
from benchmarks.limits.paths import JointPath, recorded
from benchmarks.limits.requests import PATH_FRAMES, Adversary, Requests
from benchmarks.limits.rig import Result, Rig, Row, Tell, at_most, shown
from ik_proto import Status
from ik_service.solution import BatchSolution

TITLE = "self-collision, avoided"

SEED = 5
TOUCH = 1e-9
"""Rounding of two ways to work out a distance [m]."""

BATCH = 1000
"""Requests solved at once."""

CLEAR_POSTURES = 20_000
PATH_SAMPLES = 300
"""Points at which the way to an answer is looked at: one every 0.02 rad of the farthest jump."""

ESCAPES, ESCAPE_REQUESTS = 1000, 50
"""Starts in penetration that are told to hold their wrists where they are, and how often."""

CASES = 10
"""Requests that broke a rule and are saved to be looked into."""


@dataclass
class Tally:
    """What happened to the requests of a family.

    Attributes:
        requests: How many.
        started_clear: Of these with all pairs at the margin or beyond.
        smallest_clearance: Of answers to those that started clear [m].
        broken: Answers with a pair nearer than margin and start.
        worst: By how much the worst pair of all is nearer [m]; negative when none is.
        started_below: Requests with a pair below the margin.
        deepest_start: Smallest clearance of a start [m].
        opened: Of those that started below, how much the nearest pair has opened [m].
        stuck: Of these, answers that are the start.
        outside: Answers with a joint beyond its limit.
        blocked: Answers that say the body was in the way.
        held: Answers that are the start.
        misreported: Largest error of the reported clearance [m].
        walked: Answers whose straight path was looked at.
        contact: Of these, paths on which a pair touches that did not at the start.
        path_clearance: Smallest clearance on paths from clear starts [m].
        path_deeper: How much deeper a pair gets on a path that starts in contact [m].
        cases: Requests that broke a rule.
    """

    requests: int = 0
    started_clear: int = 0
    smallest_clearance: float = np.inf
    broken: int = 0
    worst: float = -np.inf
    started_below: int = 0
    deepest_start: float = np.inf
    opened: list[np.ndarray] = field(default_factory=list)
    stuck: int = 0
    outside: int = 0
    blocked: int = 0
    held: int = 0
    misreported: float = 0.0
    walked: int = 0
    contact: int = 0
    path_clearance: float = np.inf
    path_deeper: float = 0.0
    cases: list[dict[str, Any]] = field(default_factory=list)

    def numbers(self) -> dict[str, Any]:
        """JSON-ready; keys carry their units."""
        opened = np.concatenate([*self.opened, np.empty(0)])
        return {
            "requests": self.requests,
            "started_clear": self.started_clear,
            "smallest_clearance_mm": 1e3 * self.smallest_clearance if self.started_clear else None,
            "broken": self.broken,
            "worst_mm": 1e3 * self.worst,
            "started_below": self.started_below,
            "deepest_start_mm": 1e3 * self.deepest_start,
            "opened_mm": {f"p{p}": 1e3 * float(np.percentile(opened, p)) for p in (0, 50, 100)} if len(opened) else {},
            "stuck": self.stuck,
            "outside_limits": self.outside,
            "blocked": self.blocked,
            "held": self.held,
            "misreported_mm": 1e3 * self.misreported,
            "walked": self.walked,
            "contact": self.contact,
            "path_clearance_mm": 1e3 * self.path_clearance if np.isfinite(self.path_clearance) else None,
            "path_deeper_mm": 1e3 * self.path_deeper,
            "cases": self.cases,
        }


def measure(rig: Rig, tell: Tell) -> Result:
    """Put requests through `solve_batch` and recordings through `solve`, and look at all answers."""
    tallies: dict[str, Tally] = {}
    recordings = recorded(rig.robot, rig.sizes.frames)
    total = rig.sizes.requests + sum(map(len, recordings))
    done = 0

    def advance(count: int) -> None:
        nonlocal done
        done += count
        tell(min(done, total), total)

    walked_share = rig.sizes.walked / rig.sizes.requests
    for requests, answers in solved(rig):
        tally = tallies.setdefault(requests.family, Tally())
        audit(rig, tally, requests, answers)
        tally.requests += len(requests)
        walk(rig, tally, requests, answers.q, round(walked_share * tally.requests) - tally.walked)
        advance(len(requests))
    for path in recordings:
        tally = tallies.setdefault("recorded motion", Tally())
        follow_recording(rig, tally, path)
        advance(len(path))
    numbers = {family: tally.numbers() for family, tally in tallies.items()}
    out = escape(rig, min(ESCAPES, rig.sizes.requests // 20))
    return Result([*_rows(rig, tallies), _escape_row(out)], {"seed": SEED, "families": numbers, "escape": out})


def solved(rig: Rig) -> Iterator[tuple[Requests, BatchSolution]]:
    """All requests and what `solve_batch` makes of them."""
    rng = np.random.default_rng(SEED)
    adversary = Adversary(rig.robot, rig.distances, rng, min(CLEAR_POSTURES, rig.sizes.requests))
    each = rig.sizes.requests // (2 + 2 * len(adversary.families))

    def solve(requests: Requests) -> tuple[Requests, BatchSolution]:
        targets = requests.left, requests.right
        return requests, rig.precise.solve_batch(*targets, requests.q, collision="avoid", waist=requests.waist)

    makers: list[Callable[[int], Requests]] = [adversary.random, lambda count: adversary.random(count, bent=True)]
    makers += [lambda count, family=family: adversary.jumps(family, count) for family in adversary.families]
    for make in makers:
        for count in _portions(each):
            yield solve(make(count))
    for family in adversary.families:
        for count in _portions(each // PATH_FRAMES):
            q = None
            for requests in adversary.path(family, count):
                requests, answers = solve(requests if q is None else replace(requests, q=q))
                q = answers.q
                yield requests, answers


def audit(rig: Rig, tally: Tally, requests: Requests, answers: BatchSolution) -> None:
    """Hold answers against the rules."""
    q, robot, margin = answers.q, rig.robot, rig.robot.collision.margin
    bent = None if requests.waist is None else np.array([robot.waist.motion(row) for row in requests.waist])
    d_start, d = rig.distances.pairs(requests.q, bent), rig.distances.pairs(q, bent)
    start, now = d_start.min(axis=1), d.min(axis=1)
    clear = start >= margin
    short = (np.minimum(d_start, margin) - d).max(axis=1)
    tally.started_clear += int(clear.sum())
    tally.smallest_clearance = min([tally.smallest_clearance, *now[clear].tolist()])
    # Written so that NaN breaks the rule.
    broken = ~(short <= TOUCH)
    tally.broken += int(broken.sum())
    tally.worst = float(np.fmax(tally.worst, short.max()))
    tally.started_below += int((~clear).sum())
    tally.deepest_start = min(tally.deepest_start, float(start.min()))
    tally.opened.append((now - start)[~clear])
    tally.outside += int(((q < robot.lower) | (q > robot.upper)).any(axis=1).sum())
    held = np.abs(q - requests.q).max(axis=1) < TOUCH
    tally.held += int(held.sum())
    tally.stuck += int((held & ~clear).sum())
    tally.misreported = max(tally.misreported, float(np.abs(now - answers.clearance).max()))
    tally.blocked += sum(status is Status.BLOCKED for status in answers.statuses)
    for k in np.flatnonzero(broken)[: CASES - len(tally.cases)].tolist():
        tally.cases.append(_case(requests, q, k, short[k]))


def walk(rig: Rig, tally: Tally, requests: Requests, q: np.ndarray, count: int) -> None:
    """Look all along the straight path in joint space from the start to the answer of the first requests."""
    robot, margin = rig.robot, rig.robot.collision.margin
    shares = np.linspace(0.0, 1.0, PATH_SAMPLES)[:, None]
    for k in range(min(max(count, 0), len(q))):
        along = requests.q[k] + shares * (q[k] - requests.q[k])
        waist = None
        if requests.waist is not None:
            waist = np.broadcast_to(robot.waist.motion(requests.waist[k]), (len(along), 4, 4))
        d = rig.distances.pairs(along, waist)
        apart = d[0] > 0.0
        tally.walked += 1
        tally.contact += bool((d[:, apart] <= 0.0).any())
        if (d[0] >= margin).all():
            tally.path_clearance = min(tally.path_clearance, float(d.min()))
        tally.path_deeper = max([tally.path_deeper, *(d[0] - d.min(axis=0))[~apart].tolist()])


def follow_recording(rig: Rig, tally: Tally, path: JointPath) -> None:
    """Follow a recording frame by frame from answer to answer, as a robot does, and audit every step."""
    found, q = [], path.q[0]
    for left, right in zip(path.left, path.right, strict=True):
        found.append(rig.precise.solve(left, right, q, collision="avoid"))
        q = found[-1].q
    answers = BatchSolution.of(found)
    requests = Requests("recorded motion", path.left, path.right, np.vstack([path.q[:1], answers.q[:-1]]))
    audit(rig, tally, requests, answers)
    tally.requests += len(path)


def escape(rig: Rig, count: int) -> dict[str, Any]:
    """Tell robots that touch themselves to hold their wrists where they are, and see whether they come apart."""
    rng, robot = np.random.default_rng(SEED), rig.robot
    starts = np.empty((0, robot.nq))
    while len(starts) < count:
        q = rng.uniform(robot.lower, robot.upper, (2 * count, robot.nq))
        starts = np.concatenate([starts, q[rig.distances.clearance(q) < 0.0]])
    starts = starts[:count]
    targets, q = wrists(robot, starts), starts
    for _ in range(ESCAPE_REQUESTS):
        q = rig.precise.solve_batch(*targets, q, collision="avoid").q
    before, after = rig.distances.clearance(starts), rig.distances.clearance(q)
    return {
        "starts": count,
        "requests": ESCAPE_REQUESTS,
        "clear_percent": 100.0 * float((after >= robot.collision.margin).mean()),
        "apart_percent": 100.0 * float((after > 0.0).mean()),
        "never_moved_percent": 100.0 * float((np.abs(q - starts).max(axis=1) < TOUCH).mean()),
        "opened_mm": {f"p{p}": 1e3 * float(np.percentile(after - before, p)) for p in (0, 10, 50)},
    }


def _escape_row(out: dict[str, Any]) -> Row:
    return Row(
        f"{out['starts']:,} starts in contact, told to hold their wrists there",
        f"after {out['requests']} requests {out['clear_percent']:.1f} % clear, {out['apart_percent']:.1f} % apart, "
        f"{out['never_moved_percent']:.1f} % have not moved",
    )


def _portions(count: int) -> Iterator[int]:
    return (min(BATCH, count - begin) for begin in range(0, count, BATCH))


def _case(requests: Requests, q: np.ndarray, k: int, short: float) -> dict[str, Any]:
    return {
        "short_mm": 1e3 * float(short),
        "left": requests.left[k].tolist(),
        "right": requests.right[k].tolist(),
        "q": requests.q[k].tolist(),
        "waist": None if requests.waist is None else requests.waist[k].tolist(),
        "answer": q[k].tolist(),
    }


def _rows(rig: Rig, tallies: dict[str, Tally]) -> list[Row]:
    every = list(tallies.values())
    requests = sum(tally.requests for tally in every)
    margin = rig.robot.collision.margin
    clear = sum(tally.started_clear for tally in every)
    smallest = 1e3 * min(tally.smallest_clearance for tally in every)
    rows = [
        Row(
            f"{requests:,} requests: smallest clearance of the {clear:,} that started clear",
            f"{smallest:.6f} mm",
            f"≥ {1e3 * margin:g} mm",
            smallest >= 1e3 * (margin - TOUCH),
            judged=True,
        ),
        at_most("answers with a pair nearer than margin and start", sum(tally.broken for tally in every), 0, ""),
        at_most("answers beyond a joint limit", sum(tally.outside for tally in every), 0, ""),
        at_most(
            f"{sum(tally.walked for tally in every):,} straight paths: with a new contact",
            sum(tally.contact for tally in every),
            0,
            "",
        ),
        at_most("error of the reported clearance", 1e3 * max(tally.misreported for tally in every), 1e-6, "mm"),
        shown("smallest clearance on the way from clear starts", 1e3 * min(t.path_clearance for t in every), "mm"),
        shown("deeper on the way from starts in contact, at most", 1e3 * max(t.path_deeper for t in every), "mm"),
        shown("deepest start", 1e3 * min(tally.deepest_start for tally in every), "mm"),
    ]
    for family, tally in tallies.items():
        outcome = f"{_percent(tally.blocked, tally.requests)} blocked, {_percent(tally.held, tally.requests)} held"
        opened = np.concatenate([*tally.opened, np.empty(0)])
        if len(opened):
            grown = 1e3 * float(np.median(opened))
            outcome += (
                f"; {len(opened):,} started below the margin: opened by {grown:.2f} mm (median), {tally.stuck:,} held"
            )
        rows.append(Row(f"{family}: {tally.requests:,} requests", outcome))
    return rows


def _percent(part: int, whole: int) -> str:
    return f"{100.0 * part / whole:.1f} %"
