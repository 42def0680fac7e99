"""The TOML beside a robot model: its arms and wrists, the stiffness of its joints, its costs, its shape.

Position limits, masses and efforts are in the model file (MJCF or URDF) and only there.
"""

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

PACKAGED = Path(__file__).parent


class RobotError(ValueError):
    """A robot description or model that cannot be used: one line that names the file and the joint or frame.

    Attributes:
        source: The file at fault.
    """

    def __init__(self, source: Path | str, message: str) -> None:
        """Put the file in front of the message."""
        super().__init__(f"{source}: {message}")
        self.source = Path(source)


@dataclass(frozen=True, slots=True)
class WristFrame:
    """The frame a target places.

    Attributes:
        name: Its name, such as "L_ee".
        joint: The joint whose body carries it.
        xyz: Position in that joint's frame [m].
        rpy: Orientation in that joint's frame, fixed-axis roll, pitch, yaw [rad].
    """

    name: str
    joint: str
    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class ArmDescription:
    """One arm.

    Attributes:
        side: "left" or "right".
        joints: Its joints from shoulder to wrist.
        wrist: Its controlled frame.
        elbow: The joint that bends it, at whose origin elbow hints point; None where there is none.
    """

    side: str
    joints: tuple[str, ...]
    wrist: WristFrame
    elbow: str | None = None


@dataclass(frozen=True, slots=True)
class JointDescription:
    """What a joint needs beyond the model file.

    Attributes:
        velocity: Motor velocity limit [rad/s].
        kp: Position gain [N m/rad].
        kd: Velocity gain [N m s/rad].
        home: Rest position [rad].
    """

    velocity: float = 10.0
    kp: float = 50.0
    kd: float = 1.0
    home: float = 0.0


@dataclass(frozen=True, slots=True)
class CapsuleDescription:
    """A capsule, the points within a radius of a segment, that covers a link or a part of it.

    Attributes:
        name: Its name, such as "left_forearm".
        body: The joint that moves it, or the base body.
        start: One end of its axis in that body's frame [m].
        end: The other end [m].
        radius: Its radius [m].
    """

    name: str
    body: str
    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float


@dataclass(frozen=True, slots=True)
class IgnoredPair:
    """Two capsules that are not checked against each other.

    Attributes:
        pair: Their names.
        reason: Why, in words.
    """

    pair: tuple[str, str]
    reason: str


@dataclass(frozen=True, slots=True)
class CollisionDescription:
    """What stands for the robot's shape.

    Attributes:
        margin: Clearance that an answer keeps [m].
        capsules: The capsules; none for a robot whose file has no [collision].
        ignored: Pairs not checked.
    """

    margin: float = 0.0
    capsules: tuple[CapsuleDescription, ...] = ()
    ignored: tuple[IgnoredPair, ...] = ()


@dataclass(frozen=True, slots=True)
class RobotDescription:
    """A robot as both ends see it.

    Attributes:
        name: Its name; part of the Zenoh keys.
        model: Its MJCF or URDF file.
        base: The body in whose frame targets are given.
        arms: Left, then right.
        waist: The joints between base and shoulders.
        joints: Every joint described in the file.
        presets: Weights of the costs the file defines, by preset name.
        collision: Capsules and the pairs not checked.
        source: The TOML file itself.
    """

    name: str
    model: Path
    base: str
    arms: tuple[ArmDescription, ArmDescription]
    waist: tuple[str, ...]
    joints: Mapping[str, JointDescription]
    presets: Mapping[str, Mapping[str, float]]
    collision: CollisionDescription
    source: Path

    @property
    def arm_joints(self) -> tuple[str, ...]:
        """Joint names in the order of `q` on the wire: left arm, then right arm."""
        left, right = self.arms
        return left.joints + right.joints

    def joint(self, name: str) -> JointDescription:
        """Describe a joint, with defaults for one the file does not mention."""
        return self.joints.get(name, JointDescription())


def load_description(robot: str | Path) -> RobotDescription:
    """Read a robot description.

    Args:
        robot: Name of a packaged robot ("g1"), a TOML file, or a model file with a TOML of the same name beside it.

    Returns:
        The description; the model file it names exists.

    Raises:
        RobotError: No such robot, unreadable, or something missing or wrong in it.
    """
    source = _find(robot)
    try:
        document = tomllib.loads(source.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise RobotError(source, f"cannot be read ({error})") from None
    return _Reader(source).description(document)


def _find(robot: str | Path) -> Path:
    packaged = PACKAGED / f"{robot}.toml"
    if isinstance(robot, str) and "/" not in robot and packaged.is_file():
        return packaged
    path = Path(robot)
    source = path if path.suffix == ".toml" else path.with_suffix(".toml")
    if not source.is_file():
        known = ", ".join(sorted(file.stem for file in PACKAGED.glob("*.toml")))
        raise RobotError(source, f"no such robot description; packaged robots: {known}")
    return source


class _Reader:
    """Reads fields and says in one line which one is wrong."""

    def __init__(self, source: Path) -> None:
        self.source = source

    def fail(self, message: str) -> RobotError:
        return RobotError(self.source, message)

    def description(self, document: Mapping[str, Any]) -> RobotDescription:
        model = self.source.parent / self.text(document, "model", "the file")
        if not model.is_file():
            raise self.fail(f"model file {model} does not exist")
        arms = document.get("arms")
        if not isinstance(arms, list) or [arm.get("side") for arm in arms] != ["left", "right"]:
            raise self.fail('needs two [[arms]] tables, side = "left" then side = "right"')
        left, right = (self.arm(arm) for arm in arms)
        repeated = [name for name in left.joints + right.joints if (left.joints + right.joints).count(name) > 1]
        if repeated:
            raise self.fail(f"joint {repeated[0]} is listed twice in the arms")
        return RobotDescription(
            name=self.text(document, "name", "the file"),
            model=model,
            base=self.text(document, "base", "the file"),
            arms=(left, right),
            waist=self.names(document.get("waist", {}), "joints", "[waist]", default=()),
            joints={name: self.joint(name, table) for name, table in document.get("joints", {}).items()},
            presets={
                name: self.numbers(table, f"[presets.{name}]") for name, table in document.get("presets", {}).items()
            },
            collision=self.collision(document["collision"]) if "collision" in document else CollisionDescription(),
            source=self.source,
        )

    def arm(self, table: Mapping[str, Any]) -> ArmDescription:
        where = f"{table['side']} arm"
        joints = self.names(table, "joints", where)
        wrist = table.get("wrist")
        if not isinstance(wrist, Mapping):
            raise self.fail(f"{where} needs an [arms.wrist] table")
        frame = WristFrame(
            name=self.text(wrist, "name", f"{where} wrist"),
            joint=self.text(wrist, "joint", f"{where} wrist"),
            xyz=self.triple(wrist, "xyz", f"{where} wrist"),
            rpy=self.triple(wrist, "rpy", f"{where} wrist"),
        )
        if frame.joint != joints[-1]:
            raise self.fail(
                f"{where} wrist: frame {frame.name} must sit on the last joint {joints[-1]}, not {frame.joint}"
            )
        elbow = self.text(table, "elbow", where) if "elbow" in table else None
        if elbow is not None and elbow not in joints[1:]:
            raise self.fail(f"{where}: elbow {elbow} must be one of its joints after the first")
        return ArmDescription(side=table["side"], joints=joints, wrist=frame, elbow=elbow)

    def joint(self, name: str, table: Any) -> JointDescription:
        where = f"[joints.{name}]"
        numbers = self.numbers(table, where)
        known = {field.name for field in fields(JointDescription)}
        if unknown := numbers.keys() - known:
            raise self.fail(f"{where} has no {min(unknown)}; it may have {', '.join(sorted(known))}")
        for field in ("velocity", "kp", "kd"):
            if numbers.get(field, 1.0) < 0.0:
                raise self.fail(f"{where} {field} must not be negative")
        return JointDescription(**numbers)

    def collision(self, table: Any) -> CollisionDescription:
        where = "[collision]"
        self.only(table, ("margin", "capsules", "ignored"), where)
        margin = table.get("margin")
        if not _is_number(margin) or margin < 0.0:
            raise self.fail(f"{where} needs margin, a number that is not negative")
        capsules = tuple(self.capsule(entry) for entry in self.tables(table, "capsules", where))
        names = [capsule.name for capsule in capsules]
        if repeated := [name for name in names if names.count(name) > 1]:
            raise self.fail(f"{where} has two capsules named {repeated[0]}")
        ignored = tuple(self.ignored(entry, names) for entry in self.tables(table, "ignored", where))
        pairs = [frozenset(entry.pair) for entry in ignored]
        if repeated := [entry.pair for entry, pair in zip(ignored, pairs, strict=True) if pairs.count(pair) > 1]:
            raise self.fail(f"{where} ignores {' and '.join(repeated[0])} twice")
        return CollisionDescription(margin=float(margin), capsules=capsules, ignored=ignored)

    def capsule(self, table: Any) -> CapsuleDescription:
        self.only(table, ("name", "body", "from", "to", "radius"), "a capsule")
        name = self.text(table, "name", "a capsule")
        where = f"capsule {name}"
        if missing := [key for key in ("from", "to") if key not in table]:
            raise self.fail(f"{where} needs {missing[0]}, three numbers")
        radius = table.get("radius")
        if not _is_number(radius) or radius <= 0.0:
            raise self.fail(f"{where} needs radius, a number above zero")
        return CapsuleDescription(
            name=name,
            body=self.text(table, "body", where),
            start=self.triple(table, "from", where),
            end=self.triple(table, "to", where),
            radius=float(radius),
        )

    def ignored(self, table: Any, names: Sequence[str]) -> IgnoredPair:
        where = "an ignored pair"
        self.only(table, ("pair", "reason"), where)
        pair = table.get("pair")
        if not isinstance(pair, list) or len(pair) != 2 or pair[0] == pair[1]:
            raise self.fail(f"{where} needs pair, the names of two capsules")
        if unknown := [name for name in pair if name not in names]:
            raise self.fail(f"{where} names {unknown[0]}, which is not a capsule")
        reason = table.get("reason")
        if not isinstance(reason, str) or not reason.strip():
            raise self.fail(f"the ignored pair {' and '.join(pair)} needs a reason")
        return IgnoredPair(pair=(pair[0], pair[1]), reason=reason)

    def tables(self, table: Mapping[str, Any], key: str, where: str) -> list[Any]:
        value = table.get(key, [])
        if not isinstance(value, list):
            raise self.fail(f"{where} {key} must be a list of tables")
        return value

    def only(self, table: Any, known: Sequence[str], where: str) -> None:
        if not isinstance(table, Mapping):
            raise self.fail(f"{where} must be a table")
        if unknown := table.keys() - set(known):
            raise self.fail(f"{where} has no {min(unknown)}; it may have {', '.join(known)}")

    def text(self, table: Mapping[str, Any], key: str, where: str) -> str:
        value = table.get(key)
        if not isinstance(value, str) or not value:
            raise self.fail(f"{where} needs {key}, a string")
        return value

    def names(
        self, table: Mapping[str, Any], key: str, where: str, default: tuple[str, ...] | None = None
    ) -> tuple[str, ...]:
        value = table.get(key, default)
        if not isinstance(value, list | tuple) or not all(isinstance(name, str) for name in value):
            raise self.fail(f"{where} needs {key}, a list of joint names")
        if not value and default is None:
            raise self.fail(f"{where} lists no joints")
        return tuple(value)

    def triple(self, table: Mapping[str, Any], key: str, where: str) -> tuple[float, float, float]:
        value = table.get(key, [0.0, 0.0, 0.0])
        if not isinstance(value, list) or len(value) != 3 or not all(map(_is_number, value)):
            raise self.fail(f"{where}: {key} must be three numbers")
        return (float(value[0]), float(value[1]), float(value[2]))

    def numbers(self, table: Any, where: str) -> dict[str, float]:
        if not isinstance(table, Mapping):
            raise self.fail(f"{where} must be a table")
        for key, value in table.items():
            if not _is_number(value):
                raise self.fail(f"{where} {key} must be a finite number")
        return {key: float(value) for key, value in table.items()}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
