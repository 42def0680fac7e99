"""The capsules of g1.toml cover the links: proved triangle by triangle on Unitree's own meshes.

A capsule is convex, and so is the set of points that stay in one at every angle of a joint. A triangle with all corners
in one such region is inside it; any other is divided, until its parts are inside or smaller than the resolution. So a
pass says that every point of the surface is covered, not that samples of it are.

Neighbouring links share capsules at three joints. There, coverage is asked for at every angle of the joint between.
The bounding boxes of the meshes would be looser ground: their corners are empty, and covering them as well costs up to
13 mm of radius at the forearm alone.
"""

import dataclasses
import os
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
import vendor

from ik_proto.robots import CapsuleDescription, load_description

pytestmark = pytest.mark.timeout(400)

RESOLUTION = 5e-5
"""Edge of the smallest triangle that is still divided [m]."""

ANGLES = np.linspace(0.0, 2.0 * np.pi, 1440, endpoint=False)

Capsules = dict[str, CapsuleDescription]
Region = Callable[[np.ndarray], np.ndarray]
"""Says which points of shape (n, 3), in the frame of a link, are in a convex set."""


@pytest.fixture(scope="module")
def capsules() -> Capsules:
    return {capsule.name: capsule for capsule in load_description("g1").collision.capsules}


@pytest.fixture(scope="module")
def meshes() -> Path:
    try:
        return vendor.vendor_meshes()
    except vendor.Unavailable as error:
        if "CI" in os.environ:
            pytest.fail(str(error))
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def placements() -> dict[str, np.ndarray]:
    """Pose of every body in the base frame, all joints at zero."""
    model = mujoco.MjModel.from_xml_path(str(load_description("g1").model))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    poses = {}
    for i in range(1, model.nbody):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = data.xmat[i].reshape(3, 3), data.xpos[i]
        poses[model.body(i).name] = T
    T_base_world = np.linalg.inv(poses["pelvis"])
    return {name: T_base_world @ T for name, T in poses.items()}


@pytest.fixture(scope="module")
def outline(meshes: Path) -> Callable[[str], np.ndarray]:
    """Triangles of a body in its frame, shape (n, 3, 3)."""
    spec = mujoco.MjSpec.from_file(str(vendor.vendor_file()))
    files = {mesh.name: mesh.file for mesh in spec.meshes}

    def triangles(body: str) -> np.ndarray:
        parts = []
        for geom in spec.body(body).geoms:
            if geom.meshname:
                T = pose(geom.pos, geom.quat)
                parts.append(moved(T, read_stl(meshes / files[geom.meshname])))
        return np.concatenate(parts)

    return triangles


def read_stl(file: Path) -> np.ndarray:
    """Corners of the triangles of a binary STL, shape (n, 3, 3): 80 bytes and a count, then 50 bytes each."""
    records = np.frombuffer(file.read_bytes(), np.uint8, offset=84).reshape(-1, 50)
    return records[:, 12:48].copy().view("<f4").reshape(-1, 3, 3).astype(float)


def pose(position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    T, R = np.eye(4), np.zeros(9)
    mujoco.mju_quat2Mat(R, np.asarray(quaternion, float))
    T[:3, :3], T[:3, 3] = R.reshape(3, 3), position
    return T


def moved(T: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ T[:3, :3].T + T[:3, 3]


def axis_distance(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Distance of points, shape (..., 3), to a segment."""
    along, offset = end - start, points - start
    share = np.clip(offset @ along / max(along @ along, 1e-300), 0.0, 1.0)
    return np.linalg.norm(offset - share[..., None] * along, axis=-1)


def ends(capsule: CapsuleDescription) -> tuple[np.ndarray, np.ndarray]:
    return np.array(capsule.start), np.array(capsule.end)


def inside(capsule: CapsuleDescription, T: np.ndarray | None = None) -> Region:
    """Points inside a capsule; T places the link in the capsule's body."""
    T = np.eye(4) if T is None else T
    return lambda points: axis_distance(moved(T, points), *ends(capsule)) <= capsule.radius


def at_every_angle(capsule: CapsuleDescription, T: np.ndarray, axis: int, link_turns: bool) -> Region:
    """Points inside a capsule whatever the angle of the joint between.

    T places the link in the capsule's body at angle zero. The joint turns the link about an axis of its own, or the
    capsule's body about one of that.
    """
    turns = np.array([rotation(axis, angle) for angle in ANGLES])

    def some(points: np.ndarray) -> np.ndarray:
        turned = np.einsum("aij,nj->nai", turns, points if link_turns else moved(T, points))
        lever = np.linalg.norm(np.delete(turned[:, 0], axis, axis=1), axis=1)
        turned = moved(T, turned) if link_turns else turned
        # Between two angles of the grid a point is off one of them by no more than its lever times half a step.
        return axis_distance(turned, *ends(capsule)).max(axis=1) + lever * (ANGLES[1] / 2.0) <= capsule.radius

    return lambda points: np.concatenate([some(part) for part in np.array_split(points, len(points) // 500 + 1)])


def rotation(axis: int, angle: float) -> np.ndarray:
    quaternion, R = np.zeros(4), np.zeros(9)
    mujoco.mju_axisAngle2Quat(quaternion, np.eye(3)[axis], angle)
    mujoco.mju_quat2Mat(R, quaternion)
    return R.reshape(3, 3)


def ball(center: np.ndarray, radius: float) -> Region:
    return lambda points: np.linalg.norm(points - center, axis=1) <= radius


def shoulder_ball(shoulders: CapsuleDescription, T_pitch_torso: np.ndarray) -> tuple[np.ndarray, float]:
    """The ball at one end of the shoulders' capsule as a ball about the pitch axis: center and radius.

    Its own center is off that axis by a rounding, which the radius gives up: then no pitch leads a point out of it.
    """
    x, y, z = min((moved(T_pitch_torso, end) for end in ends(shoulders)), key=lambda end: float(np.linalg.norm(end)))
    return np.array([0.0, y, 0.0]), shoulders.radius - float(np.hypot(x, z))


def around_roll_axis(center: np.ndarray, radius: float) -> Region:
    """Points within a ball whatever angle they are turned to about the x axis: a convex set."""
    return lambda points: (
        np.hypot(points[:, 0] - center[0], np.hypot(*points[:, 1:].T) + np.hypot(*center[1:])) <= radius
    )


def cover(side: str, c: Capsules, T: dict[str, np.ndarray]) -> dict[str, list[Region]]:
    """Regions of each link's frame that the capsules cover, whatever the joints do; the legs are straight.

    Args:
        side: "left" or "right", for the links of arm and leg.
        c: The capsules.
        T: Pose of every body in the base frame, all joints at zero.

    Returns:
        Convex regions by the name of the link.
    """

    def relative(parent: str, child: str) -> np.ndarray:
        return np.linalg.inv(T[parent]) @ T[child]

    upper_arm, forearm, wrist, thigh = (c[f"{side}_{part}"] for part in ("upper_arm", "forearm", "wrist", "thigh"))
    shoulder, roll, yaw = (f"{side}_shoulder_{joint}_link" for joint in ("pitch", "roll", "yaw"))
    center, radius = shoulder_ball(c["shoulders"], relative(shoulder, "torso_link"))
    elbow, fork = f"{side}_elbow_link", f"{side}_wrist_roll_link"
    # Waist roll and pitch turn about one point, the origin of the torso.
    room = c["torso_left"].radius - axis_distance(np.zeros(3), *ends(c["torso_left"]))
    knuckle = relative(f"{side}_wrist_yaw_link", f"{side}_wrist_pitch_link") @ [*wrist.end, 1.0]
    return {
        "torso_link": [inside(c[name]) for name in ("shoulders", "torso_left", "torso_right", "head")],
        "waist_roll_link": [ball(np.zeros(3), float(room))],
        "waist_yaw_link": [at_every_angle(c["pelvis"], T["waist_yaw_link"], 2, link_turns=True)],
        "pelvis": [inside(c["pelvis"]), inside(c["hips"])],
        f"{side}_hip_pitch_link": [inside(capsule, T[f"{side}_hip_pitch_link"]) for capsule in (c["hips"], thigh)],
        f"{side}_hip_roll_link": [inside(thigh, T[f"{side}_hip_roll_link"])],
        f"{side}_hip_yaw_link": [inside(thigh, T[f"{side}_hip_yaw_link"])],
        shoulder: [ball(center, radius)],
        roll: [
            around_roll_axis(moved(relative(roll, shoulder), center), radius),
            at_every_angle(upper_arm, relative(yaw, roll), 2, link_turns=False),
        ],
        yaw: [inside(upper_arm)],
        elbow: [inside(forearm)],
        fork: [at_every_angle(forearm, relative(elbow, fork), 0, link_turns=True)],
        f"{side}_wrist_pitch_link": [inside(wrist)],
        f"{side}_wrist_yaw_link": [
            # About the yaw axis: the hand cannot turn out of it.
            ball(np.array([0.0, 0.0, knuckle[2]]), wrist.radius - float(np.hypot(*knuckle[:2]))),
            inside(c[f"{side}_thumb"]),
            inside(c[f"{side}_fingers"]),
        ],
    }


def uncovered(triangles: np.ndarray, covered: list[Region]) -> np.ndarray:
    """Points of a surface not shown to be in any of the regions, shape (n, 3); none for a covered surface."""
    while len(triangles):
        points, places = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
        member = np.array([region(points) for region in covered])
        if not member.any(axis=0).all():
            return points[~member.any(axis=0)]
        triangles = triangles[~member[:, places.ravel()].reshape(len(covered), -1, 3).all(axis=2).any(axis=0)]
        edges = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
        if (edges < RESOLUTION).any():
            return triangles[edges < RESOLUTION].mean(axis=1)
        a, b, c = triangles.transpose(1, 0, 2)
        ab, bc, ca = (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
    return np.empty((0, 3))


LINKS = [
    *("torso_link", "waist_roll_link", "waist_yaw_link", "pelvis"),
    *(
        f"{side}_{link}_link"
        for side in ("left", "right")
        for link in ("hip_pitch", "hip_roll", "hip_yaw", "shoulder_pitch", "shoulder_roll", "shoulder_yaw")
    ),
    *(
        f"{side}_{link}_link"
        for side in ("left", "right")
        for link in ("elbow", "wrist_roll", "wrist_pitch", "wrist_yaw")
    ),
]


def cover_of(link: str, capsules: Capsules, placements: dict[str, np.ndarray]) -> list[Region]:
    return cover("right" if link.startswith("right") else "left", capsules, placements)[link]


@pytest.mark.parametrize("link", LINKS)
def test_capsules_cover_the_link(
    link: str, capsules: Capsules, placements: dict[str, np.ndarray], outline: Callable[[str], np.ndarray]
) -> None:
    left_out = uncovered(outline(link), cover_of(link, capsules, placements))
    assert len(left_out) == 0, f"{len(left_out)} points of {link} are not covered, such as {left_out[0]}"


NEEDED_BY = {
    "shoulders": "left_shoulder_pitch_link",
    "torso_left": "torso_link",
    "torso_right": "torso_link",
    "head": "torso_link",
    "pelvis": "pelvis",
    "hips": "left_hip_pitch_link",
    **{
        f"{side}_{capsule}": f"{side}_{link}_link"
        for side in ("left", "right")
        for capsule, link in {
            "thigh": "hip_yaw",
            "upper_arm": "shoulder_yaw",
            "forearm": "elbow",
            "wrist": "wrist_pitch",
            "thumb": "wrist_yaw",
            "fingers": "wrist_yaw",
        }.items()
    },
}
"""A link that each capsule is needed for."""


def test_every_capsule_has_its_link(capsules: Capsules) -> None:
    assert {*NEEDED_BY, "torso_core"} == set(capsules)


@pytest.mark.parametrize("name", NEEDED_BY)
def test_a_capsule_2_mm_thinner_leaves_its_link_bare(
    name: str, capsules: Capsules, placements: dict[str, np.ndarray], outline: Callable[[str], np.ndarray]
) -> None:
    thin = {**capsules, name: dataclasses.replace(capsules[name], radius=capsules[name].radius - 2e-3)}
    assert len(uncovered(outline(NEEDED_BY[name]), cover_of(NEEDED_BY[name], thin, placements)))


OVERLAP = 0.015
"""How deep an upper arm may be in the torso that keeps the margin from its core [m], as g1.toml says."""


def test_an_upper_arm_clear_of_the_torsos_core_is_hardly_in_the_torso(
    capsules: Capsules, outline: Callable[[str], np.ndarray]
) -> None:
    description = load_description("g1")
    spec = mujoco.MjSpec.from_file(str(description.model))
    names = ("left_upper_arm", "torso_core", "torso_right")
    for name in names:
        geometry = {"fromto": [*capsules[name].start, *capsules[name].end], "size": [capsules[name].radius, 0.0, 0.0]}
        spec.joint(capsules[name].body).parent.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_CAPSULE, **geometry)
    model = spec.compile()
    data, arm = mujoco.MjData(model), [model.geom(name).id for name in names]

    def corners(body: str) -> np.ndarray:
        return np.unique(outline(body).reshape(-1, 3), axis=0)  # triangles share them

    def pose_in_torso(body: str) -> np.ndarray:
        torso, link = data.body("torso_link"), data.body(body)
        T = np.eye(4)
        T[:3, :3] = torso.xmat.reshape(3, 3).T @ link.xmat.reshape(3, 3)
        T[:3, 3] = torso.xmat.reshape(3, 3).T @ (link.xpos - torso.xpos)
        return T

    rng = np.random.default_rng(8)
    directions = np.concatenate([rng.normal(size=(600, 3)), np.eye(3), -np.eye(3)])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    torso = corners("torso_link")
    # Half-spaces that hold the torso below its neck; a point is no deeper in it than in the shallowest of them.
    reach = (torso[torso[:, 2] < 0.31] @ directions.T).max(axis=0)
    outermost, middle = {}, {}
    for body in ("left_shoulder_roll_link", "left_shoulder_yaw_link"):
        points = corners(body)
        outermost[body] = points[np.unique((points @ rng.normal(size=(3, 800))).argmax(axis=0))]
        middle[body] = (outermost[body].max(axis=0) + outermost[body].min(axis=0)) / 2.0

    def depths(points: np.ndarray) -> np.ndarray:
        return (reach - points @ directions.T).min(axis=-1)

    joints = [model.joint(f"left_shoulder_{name}_joint") for name in ("pitch", "roll", "yaw")]
    deepest, clear = 0.0, 0
    for _ in range(6000):
        for joint in joints:
            data.qpos[joint.qposadr[0]] = rng.uniform(*joint.range)
        mujoco.mj_kinematics(model, data)
        near = min(mujoco.mj_geomDistance(model, data, arm[0], other, 1.0, None) for other in arm[1:])
        if near < description.collision.margin:
            continue
        clear += 1
        for body, points in outermost.items():
            T = pose_in_torso(body)
            # A point is deeper than another by no more than their distance: most poses need no look at single points.
            room = deepest - float(depths(moved(T, middle[body])))
            near = points[np.linalg.norm(points - middle[body], axis=1) > room]
            if len(near):
                deepest = max(deepest, float(depths(moved(T, near)).max()))
    assert clear > 2000
    assert 0.0 < deepest <= OVERLAP
