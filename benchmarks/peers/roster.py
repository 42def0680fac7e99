"""Who is compared, with which settings, and where those come from.

A peer runs with the settings that its own documentation or examples show for its purpose. Where others are known to
do better on a workload, they get a row of their own beside it ("tuned": most accurate on a path; "damped": no chatter
beyond reach). Peers that take one step a frame on a path iterate on `cold`, up to 100 steps, as their examples for
reaching a pose do. The tuned settings were searched on these kinds of workloads, which leans in the peers' favour.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Settings = dict[str, Any]

ROBOT = "g1"
COLD_STEPS = 100


@dataclass(frozen=True)
class Row:
    """A solver with its settings.

    Attributes:
        name: What tables call it.
        peer: What `--peers` calls the group of rows it belongs to.
        solver: Module of `benchmarks.peers.solvers`.
        settings: Its settings on a path.
        source: Where the settings come from.
        instead: Settings that replace some of them on a workload, by its name; None: not run there.
        group: Dependency group of its environment; empty for the project's own.
        packages: Distributions whose versions are reported.
    """

    name: str
    peer: str
    solver: str
    settings: Settings
    source: str
    instead: Mapping[str, Settings | None] = field(default_factory=dict)
    group: str = ""
    packages: tuple[str, ...] = ()

    def settings_on(self, workload: str) -> Settings | None:
        """Settings for a workload; None where the row is not run."""
        other = self.instead.get(workload, {})
        return None if other is None else self.settings | other


def _ours(suffix: str, preset: str, compiled: bool, collision: str, source: str, cold: str = "reach") -> Row:
    settings = {"robot": ROBOT, "preset": preset, "compiled": compiled, "mode": "track", "collision": collision}
    return Row(f"ik-service {suffix}", "ours", "ours", settings, source, {"cold": {"mode": cold}})


OURS = (
    _ours("precise (C)", "precise", True, "off", "without self-collision, as the peers; mode reach on cold"),
    _ours("precise (C, avoid)", "precise", True, "avoid", "defaults of the service; mode reach on cold"),
    _ours("precise (VM)", "precise", False, "off", "without a compiler"),
    _ours("openwbt (C)", "openwbt", True, "off", "the cost of the Ipopt row", cold="track"),
)

REFERENCE = Row(
    "OpenWBT formulation (Ipopt)",
    "reference",
    "reference",
    {"robot": ROBOT, "preset": "openwbt"},
    "OpenWBT and xr_teleoperate, robot_arm_ik.py: weights 50/1/0.02/0.1, max_iter 50, tol 1e-6",
    packages=("casadi",),
)

_PINK_EXAMPLE: Settings = {
    "position_cost": 1.0,
    "orientation_cost": 1.0,
    "lm_damping": 1.0,
    "posture_cost": 1e-3,
    "damping": 1e-12,
    "qp": "quadprog",
    "dt": 0.02,
    "velocity_limits": True,
    "steps": 1,
}
_PINK_COLD: Settings = {
    "lm_damping": 0.0,
    "posture_cost": 0.0,
    "damping": 1e-8,
    "qp": "daqp",
    "dt": 0.01,
    "steps": COLD_STEPS,
}
# The same problem in pink and mink, so the same search served both.
_TUNED: Settings = {
    "position_cost": 7.0,
    "lm_damping": 1e-2,
    "posture_cost": 1e-3,
    "damping": 1e-12,
    "velocity_limits": True,
    "steps": 1,
}
_TUNED_COLD: Settings = {
    "position_cost": 30.0,
    "lm_damping": 1e-3,
    "posture_cost": 0.0,
    "velocity_limits": False,
    "steps": COLD_STEPS,
}
_DAMPED: Settings = _TUNED | {"lm_damping": 1.0, "posture_cost": 1e-2}
_MINK_EXAMPLE: Settings = _PINK_EXAMPLE | {"posture_cost": 0.0, "damping": 1e-3}
_PLACO_EXAMPLE: Settings = {
    "position_weight": 1.0,
    "orientation_weight": 1.0,
    "regularization": 0.0,
    "velocity_limits": True,
    "steps": 1,
}
_PLACO_TUNED: Settings = _PLACO_EXAMPLE | {"position_weight": 50.0, "regularization": 1e-4}
_OINK_EXAMPLE: Settings = {
    "position_cost": 1.0,
    "orientation_cost": 0.1,
    "lm_damping": 0.01,
    "regularization": 1e-6,
    "velocity_limits": True,
    "steps": 1,
}
_OINK_TUNED: Settings = _OINK_EXAMPLE | {"position_cost": 7.0, "orientation_cost": 1.0}
_OINK_COLD: Settings = {
    "position_cost": 30.0,
    "lm_damping": 1e-3,
    "velocity_limits": False,
    "steps": COLD_STEPS,
}
_SEARCH = "tuned by search for these workloads"
_CHATTER = "tuned by search; Levenberg-Marquardt damping 1 against chatter beyond reach"


def _variants(peer: str, solver: str, group: str, packages: tuple[str, ...], *rows: tuple[Any, ...]) -> list[Row]:
    """Rows of one peer: (suffix, settings, source, instead)."""
    return [
        Row(f"{peer}{suffix}", peer, solver, settings, source, instead, group, packages)
        for suffix, settings, source, instead in rows
    ]


PEERS = (
    *_variants(
        "pink",
        "pink_peer",
        "pink",
        ("pin-pink", "pin", "quadprog", "daqp"),
        ("", _PINK_EXAMPLE, "examples/arm_ur5.py; cold: examples/inverse_kinematics_ur10.py", {"cold": _PINK_COLD}),
        (" (tuned)", _PINK_EXAMPLE | _TUNED, _SEARCH, {"cold": _TUNED_COLD}),
        (" (damped)", _PINK_EXAMPLE | _DAMPED, _CHATTER, {"cold": None}),
    ),
    *_variants(
        "mink",
        "mink_peer",
        "mink",
        ("mink", "mujoco", "quadprog"),
        ("", _MINK_EXAMPLE, "examples/arm_ur5e.py", {"cold": {"velocity_limits": False, "steps": COLD_STEPS}}),
        (" (tuned)", _MINK_EXAMPLE | _TUNED, _SEARCH, {"cold": _TUNED_COLD}),
        (" (damped)", _MINK_EXAMPLE | _DAMPED, _CHATTER, {"cold": None}),
    ),
    *_variants(
        "placo",
        "placo_peer",
        "placo",
        ("placo", "pin"),
        (
            "",
            _PLACO_EXAMPLE,
            "placo-examples kinematics/6axis_targets.py",
            {"cold": {"velocity_limits": False, "steps": COLD_STEPS}},
        ),
        (
            " (tuned)",
            _PLACO_TUNED,
            f"{_SEARCH}; regularization 1e-4 of its documentation",
            {
                "cold": {
                    "position_weight": 900.0,
                    "regularization": 1e-3,
                    "velocity_limits": False,
                    "steps": COLD_STEPS,
                }
            },
        ),
        (
            " (damped)",
            _PLACO_TUNED | {"regularization": 1.0},
            "tuned by search; regularization 1 against chatter beyond reach",
            {"cold": None},
        ),
    ),
    *_variants(
        "roboplan-oink",
        "oink_peer",
        "oink",
        ("roboplan-oink", "pin"),
        (
            "",
            _OINK_EXAMPLE,
            "roboplan_examples/python/example_oink.py without its posture task, which costs accuracy",
            {"cold": {"velocity_limits": False, "steps": COLD_STEPS}},
        ),
        (" (tuned)", _OINK_TUNED, _SEARCH, {"cold": _OINK_COLD}),
        (" (damped)", _OINK_TUNED | {"lm_damping": 1.0}, _CHATTER, {"cold": None}),
    ),
    Row(
        "roboticstoolbox ik_LM",
        "roboticstoolbox",
        "roboticstoolbox_peer",
        {"ilimit": 30, "slimit": 100, "tol": 1e-6},
        "defaults of ETS.ik_LM",
        group="roboticstoolbox",
        packages=("roboticstoolbox-python",),
    ),
    Row(
        "optik",
        "optik",
        "optik_peer",
        {"solution_mode": "speed", "max_time": 0.1, "tol_f": 1e-6},
        "defaults of SolverConfig; unreachable: 5 ms instead of 100 ms, or a frame would take 200 ms",
        {"unreachable": {"max_time": 0.005}},
        group="optik",
        packages=("optik-py",),
    ),
    Row(
        "trac-ik",
        "trac-ik",
        "tracik_peer",
        {"timeout": 0.005, "epsilon": 1e-5, "solve_type": "Speed"},
        "defaults of TRAC-IK and of pytracik",
        group="trac-ik",
        packages=("pytracik",),
    ),
    Row(
        "pyroki (almond fork)",
        "pyroki",
        "pyroki_peer",
        {"position_weight": 50.0, "orientation_weight": 10.0, "rest_weight": 1.0, "damping": 10.0, "iterations": 100},
        "examples/pyroki_snippets/_solve_ik_with_multiple_targets.py, started and held at the request's q",
        group="pyroki",
        packages=("almond-pyroki", "almond-jaxls", "jax"),
    ),
)

ROWS: tuple[Row, ...] = (*OURS, REFERENCE, *PEERS)
