"""Pictures: what must be seen is seen, the film can be read, and a machine that cannot render says so in one line."""

from collections.abc import Iterator
from pathlib import Path

import imageio.v3 as iio
import mujoco
import numpy as np
import pytest
from sim_fakes import steps_to

from ik_client import Command, LoopState, TickReport
from ik_proto import Array
from ik_proto.robots import RobotDescription
from sim_client.arms import ArmKinematics
from sim_client.eyes import TICKS_PER_PAIR, write_eyes
from sim_client.gl import NoRendering, find_backend
from sim_client.offscreen import Image, Offscreen
from sim_client.render import VIEW, Stage, render_stereo
from sim_client.robot import SimRobot
from sim_client.scene import COLOURS
from sim_client.trace import Tick
from sim_client.video import FRAME_RATE, STILL_WIDTH, strip, write_video

RAISED = np.array([-0.6, 0.2, 0.0, 0.2, 0.0, 0.0, 0.0, -0.6, -0.2, 0.0, 0.2, 0.0, 0.0, 0.0])
"""Arm joints with both hands before the chest [rad]."""

BEHIND = np.array([1.2, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 1.2, -0.3, 0.0, 0.0, 0.0, 0.0, 0.0])
"""Arm joints with both hands behind the back [rad]."""


@pytest.fixture(scope="module", autouse=True)
def rendering() -> None:
    try:
        find_backend()
    except NoRendering as fault:
        pytest.skip(str(fault))


@pytest.fixture(scope="module")
def stage(g1: RobotDescription) -> Iterator[Stage]:
    with Stage(g1) as stage:
        yield stage


def posed(g1: RobotDescription, q: Array) -> SimRobot:
    """A robot whose arms are put somewhere."""
    robot = SimRobot(g1)
    for name, position in zip(g1.arm_joints, q, strict=True):
        robot.data.joint(name).qpos[0] = position
    return robot


def ticks_of(g1: RobotDescription, arms: ArmKinematics, count: int, *, aside: float = 0.0) -> list[Tick]:
    """Arms that rise, with targets a distance to the left of the wrists [m]."""
    ticks = []
    home = SimRobot(g1).read().q
    for i in range(count):
        q = home + (RAISED - home) * i / max(count - 1, 1)
        robot = posed(g1, q)
        wrists = arms.wrists(q)
        shift = np.zeros((4, 4))
        shift[1, 3] = aside
        report = TickReport(
            time=0.02 * i,
            state=LoopState.TRACKING,
            reason="",
            command=Command(q, np.zeros(14), 0.0),
            arms=steps_to(wrists[0] + shift, wrists[1] + shift),
        )
        ticks.append(Tick(i, 0.02 * (i + 1), report, robot.data.qpos.copy(), wrists, 0.0, 0.001))
    return ticks


def coloured(picture: Image, colour: tuple[float, float, float]) -> int:
    """Pixels whose hue is about that of a colour, and which are not grey."""
    pixels = picture.reshape(-1, 3).astype(float)
    pixels = pixels[np.ptp(pixels, axis=1) > 60.0]
    unit = np.array(colour) / np.linalg.norm(colour)
    return int((pixels @ unit / np.linalg.norm(pixels, axis=1) > 0.95).sum())


def test_the_view_shows_both_targets(stage: Stage, g1: RobotDescription, g1_arms: ArmKinematics) -> None:
    picture = stage.view(ticks_of(g1, g1_arms, 1, aside=0.2))
    assert picture.shape == (VIEW[1], VIEW[0], 3)
    assert picture.dtype == np.uint8
    for colour in COLOURS:
        assert coloured(picture, colour) > 300


def test_trails_are_drawn(stage: Stage, g1: RobotDescription, g1_arms: ArmKinematics) -> None:
    ticks = ticks_of(g1, g1_arms, 60)
    with_trail, without = stage.view(ticks), stage.view(ticks[-1:])
    assert (with_trail != without).any(axis=2).sum() > 300


def test_the_same_tick_gives_the_same_picture(stage: Stage, g1: RobotDescription, g1_arms: ArmKinematics) -> None:
    """Negative control of the comparisons here: nothing differs by itself."""
    ticks = ticks_of(g1, g1_arms, 3)
    np.testing.assert_array_equal(stage.view(ticks), stage.view(ticks))


def eyes_of(robot: SimRobot, *, hands: bool) -> Image:
    """What the eyes see, with the hands or as if there were none."""
    links = [robot.model.body(f"{side}_wrist_yaw_link").id for side in ("left", "right")]
    of_hands = np.isin(robot.model.geom_bodyid, links)
    if not hands:
        robot.model.geom_matid[of_hands] = -1
        robot.model.geom_rgba[of_hands, 3] = 0.0
    mujoco.mj_forward(robot.model, robot.data)
    with Offscreen(robot.model) as offscreen:
        return render_stereo(offscreen, robot.model, robot.data)


def hand_pixels(g1: RobotDescription, q: Array) -> list[int]:
    """How many pixels of the left and of the right eye's picture the hands fill."""
    with_hands, without = (eyes_of(posed(g1, q), hands=hands) for hands in (True, False))
    return [int(half.any(axis=2).sum()) for half in np.hsplit(with_hands != without, 2)]


def test_the_eyes_see_raised_hands(g1: RobotDescription) -> None:
    assert min(hand_pixels(g1, RAISED)) > 2000


def test_the_eyes_do_not_see_hands_behind_the_back(g1: RobotDescription) -> None:
    assert hand_pixels(g1, BEHIND) == [0, 0]


def test_the_eyes_differ(g1: RobotDescription) -> None:
    """Near things are further right in the left eye."""
    pair = eyes_of(posed(g1, RAISED), hands=True)
    assert pair.shape == (480, 1280, 3)
    assert pair.dtype == np.uint8
    left, right = np.hsplit(pair, 2)
    columns = [np.flatnonzero((eye < 90).all(axis=2).any(axis=0)) for eye in (left, right)]
    assert columns[0].min() > columns[1].min()
    assert columns[0].max() > columns[1].max() - 1


def test_a_robot_without_eyes_is_told_so(toy: RobotDescription) -> None:
    robot = SimRobot(toy)
    with Offscreen(robot.model) as offscreen, pytest.raises(ValueError, match="no cameras left_eye and right_eye"):
        render_stereo(offscreen, robot.model, robot.data)


def test_stereo_pairs_are_written(stage: Stage, g1: RobotDescription, g1_arms: ArmKinematics, tmp_path: Path) -> None:
    ticks = ticks_of(g1, g1_arms, 2 * TICKS_PER_PAIR)
    assert write_eyes(tmp_path / "eyes", stage, ticks) == 2
    files = sorted(path.name for path in (tmp_path / "eyes").iterdir())
    assert files == [f"{side}_{number:06d}.png" for side in ("left", "right") for number in (0, TICKS_PER_PAIR)]
    pair = np.hstack([iio.imread(tmp_path / "eyes" / f"{side}_{TICKS_PER_PAIR:06d}.png") for side in ("left", "right")])
    np.testing.assert_array_equal(pair, stage.stereo(ticks[TICKS_PER_PAIR]))


def test_the_film_has_a_frame_every_other_tick(
    stage: Stage, g1: RobotDescription, g1_arms: ArmKinematics, tmp_path: Path
) -> None:
    ticks = ticks_of(g1, g1_arms, 13)
    file = tmp_path / "new" / "film.mp4"
    assert write_video(file, stage, ticks) == 7
    frames = list(iio.imiter(file, plugin="pyav"))
    assert len(frames) == 7
    assert frames[0].shape == (VIEW[1], VIEW[0], 3)
    assert iio.immeta(file, plugin="pyav")["fps"] == FRAME_RATE == 25
    # The codec loses a little, and not the picture.
    assert np.abs(frames[-1].astype(float) - stage.view(ticks)).mean() < 6.0


def test_the_strip_has_its_stills_side_by_side(stage: Stage, g1: RobotDescription, g1_arms: ArmKinematics) -> None:
    picture = strip(stage, ticks_of(g1, g1_arms, 30), count=3)
    assert picture.shape == (VIEW[1], 3 * STILL_WIDTH, 3)
    first, last = picture[:, :STILL_WIDTH], picture[:, -STILL_WIDTH:]
    assert (first != last).any(axis=2).sum() > 1000


def test_rendering_leaves_the_robot_alone(stage: Stage, g1: RobotDescription, g1_arms: ArmKinematics) -> None:
    ticks = ticks_of(g1, g1_arms, 2)
    before = ticks[1].qpos.copy()
    stage.view(ticks)
    np.testing.assert_array_equal(ticks[1].qpos, before)
