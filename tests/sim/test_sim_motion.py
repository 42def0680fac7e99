"""Seeing how the wrists shall move and do: measured in the physics, drawn as arrows and bars, and never obeyed."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from sim_fakes import FakeClock

from ik_client import Command, WristMotion
from ik_client.robot_end import EndState
from ik_proto.limits import SINGULAR_TWIST
from ik_proto.robots import RobotDescription
from sim_client.gl import NoRendering, find_backend
from sim_client.motion_arrows import ASKED, MEASURED, draw_motion, place_marks
from sim_client.motion_panel import NEAR, SIZE, THERE, WELL, draw_panel
from sim_client.motion_view import MotionView, look, measured_twists
from sim_client.offscreen import Image, Offscreen, free_camera
from sim_client.robot import CONTROL_PERIOD, MOTION_LASTS, SimRobot

RAMP = 0.1
UP = np.array([[0.0, 0.0, 0.2, 0.0, 0.0, 0.0], [0.0, 0.0, 0.2, 0.0, 0.0, 0.0]])
RAISED = np.array([-0.5, 0.35, 0.0, -0.1, 0.0, 0.0, 0.0, -0.5, -0.35, 0.0, -0.1, 0.0, 0.0, 0.0])
PROMISED = WristMotion(UP, UP, np.array([20.0, 20.0]) * SINGULAR_TWIST)


class Rig:
    """A robot on a fake clock, and who commands it."""

    def __init__(self, description: RobotDescription) -> None:
        self.clock, self.seq = FakeClock(), 0
        self.robot = SimRobot(description, clock=self.clock, ramp=RAMP)
        for _ in range(round(RAMP / CONTROL_PERIOD) + 3):
            q_set = self.robot.read().q_set
            self.tick(self.robot.read().q if q_set is None else q_set)
        assert self.robot.guard.state is EndState.READY
        q_set = self.robot.read().q_set
        assert q_set is not None
        self.q = q_set

    def tick(self, q: np.ndarray, *, engaged: bool = False, motion: WristMotion | None = None) -> None:
        self.seq += 1
        command = Command(
            q, np.zeros(len(q)), self.clock.now, session="s", seq=self.seq, engaged=engaged, motion=motion
        )
        self.robot.send(command)
        self.robot.advance()
        self.clock.now += CONTROL_PERIOD

    def swing(self, ticks: int, motion: WristMotion | None = None) -> list[np.ndarray]:
        """Move all joints to and fro, and keep the set-points."""
        begin, setpoints = self.q, []
        for k in range(ticks):
            self.q = begin + 0.1 * np.sin(0.1 * k)
            self.tick(self.q, engaged=k > 0, motion=motion)
            setpoints.append(self.robot.read().q_set)
        return setpoints


def test_the_robot_moves_as_without_it(toy: RobotDescription) -> None:
    """To the last bit, whatever is said of the motion."""
    plain, shown = Rig(toy), Rig(toy)
    nonsense = replace(PROMISED, twists=-50.0 * UP, achieved=70.0 * UP)
    np.testing.assert_array_equal(plain.swing(60), shown.swing(60, nonsense))
    look(shown.robot)
    np.testing.assert_array_equal(plain.swing(10), shown.swing(10, nonsense))
    np.testing.assert_array_equal(plain.robot.data.qpos, shown.robot.data.qpos)
    assert plain.robot.motion is None
    assert shown.robot.motion is nonsense


def test_it_is_shown_while_it_is_new(toy: RobotDescription) -> None:
    rig = Rig(toy)
    assert look(rig.robot) is None
    rig.tick(rig.q, motion=PROMISED)
    assert look(rig.robot) is not None
    rig.clock.now += 0.9 * MOTION_LASTS - CONTROL_PERIOD
    assert look(rig.robot) is not None
    rig.clock.now += 0.2 * MOTION_LASTS
    assert look(rig.robot) is None
    rig.tick(rig.q, motion=PROMISED)
    rig.tick(rig.q)
    assert look(rig.robot) is None


def test_of_a_command_that_is_refused_nothing_is_shown(toy: RobotDescription) -> None:
    rig = Rig(toy)
    rig.robot.send(Command(rig.q, np.zeros(len(rig.q)), 0.0, session="other", seq=1, motion=PROMISED))
    assert look(rig.robot) is None


def test_measured_is_what_the_physics_does(g1: RobotDescription) -> None:
    """By central differences of the wrists' poses, whatever was promised."""
    rig = Rig(g1)
    rig.swing(12, PROMISED)
    step, before, data = 1e-6, rig.robot.wrists(), rig.robot.data
    measured, q, dq = measured_twists(rig.robot), data.qpos.copy(), data.qvel.copy()
    view = look(rig.robot)
    assert view is not None
    np.testing.assert_array_equal(view.measured, measured)
    assert np.linalg.norm(measured[:, :3], axis=1).min() > 0.02
    assert view.motion is PROMISED
    moved = []
    for sign in (-1.0, 1.0):
        data.qpos[:] = q
        # The model has quaternions nowhere: its base is held and all its joints are hinges.
        data.qpos[:] += sign * step * dq
        mujoco.mj_kinematics(rig.robot.model, data)
        moved.append(rig.robot.wrists())
    for arm in (0, 1):
        change = (moved[1][arm] - moved[0][arm]) / (2.0 * step)
        np.testing.assert_allclose(measured[arm, :3], change[:3, 3], rtol=0.0, atol=1e-6)
        turn = change[:3, :3] @ before[arm][:3, :3].T
        np.testing.assert_allclose(measured[arm, 3:], [turn[2, 1], turn[0, 2], turn[1, 0]], rtol=0.0, atol=1e-6)


@pytest.fixture(scope="module")
def rendering() -> None:
    try:
        find_backend()
    except NoRendering as fault:
        pytest.skip(str(fault))


def view_of(robot: SimRobot, asked: np.ndarray, measured: np.ndarray) -> MotionView:
    view = look(robot)
    assert view is not None
    return replace(view, motion=replace(view.motion, twists=asked), measured=measured)


def pixels_of(picture: Image, colour: tuple[float, float, float]) -> np.ndarray:
    """Rows and columns of pixels with about the hue of a colour, and which are not grey."""
    pixels = picture.astype(float)
    unit = np.array(colour) / np.linalg.norm(colour)
    bright = np.ptp(pixels, axis=2) > 60.0
    length = np.linalg.norm(pixels, axis=2) + 1e-9
    return np.argwhere(bright & (pixels @ unit / length > 0.975))


def test_arrows_are_drawn_where_the_wrists_go(g1: RobotDescription, rendering: None) -> None:
    """A picture with arrows against one without: up is up, a longer arrow is longer, and none means none."""
    rig = Rig(g1)
    while np.abs(RAISED - rig.q).max() > 1e-9:
        rig.q = rig.q + np.clip(RAISED - rig.q, -0.03, 0.03)
        rig.tick(rig.q, engaged=True, motion=PROMISED)
    robot, still = rig.robot, np.zeros((2, 6))
    camera = free_camera(np.array([0.2, 0.0, 1.1]), 1.6, 180.0, 0.0)
    with Offscreen(robot.model) as offscreen:

        def picture(asked: np.ndarray, measured: np.ndarray) -> Image:
            view = view_of(robot, asked, measured)
            place_marks(robot, view)
            mujoco.mj_forward(robot.model, robot.data)
            return offscreen.image(
                robot.data, camera, 640, 480, draw=lambda scene: draw_motion(scene, robot, view)
            ).copy()

        nothing, asked, half = (picture(*twists) for twists in ((still, still), (UP, still), (UP, 0.5 * UP)))
        down, alone = picture(-UP, still), picture(still, UP)
        turned = picture(still, np.roll(6.0 * UP, 3, axis=1))
    assert len(pixels_of(nothing, ASKED)) < 20
    assert len(pixels_of(nothing, MEASURED)) < 20
    up, low = pixels_of(asked, ASKED), pixels_of(down, ASKED)
    assert len(up) > 300
    assert up[:, 0].min() < low[:, 0].min() - 30
    assert len(pixels_of(asked, MEASURED)) < 20
    assert len(pixels_of(alone, MEASURED)) > 100
    # Inside the asked one the measured one shines through, and reaches half as far.
    tinted = np.argwhere((asked[..., 0].astype(int) - half[..., 0]) > 30)
    assert len(tinted) > 40
    assert tinted[:, 0].min() > up[:, 0].min() + 15
    assert len(pixels_of(turned, MEASURED)) > 40
    # Both hands have one: left and right of the middle of the picture.
    assert (up[:, 1] < 320).sum() > 100
    assert (up[:, 1] > 320).sum() > 100


def counted(panel: Image, colour: tuple[int, int, int], half: int) -> int:
    """Pixels of a colour in the left or the right half of a panel, below its legend."""
    part = panel[30:, : SIZE[0] // 2] if half == 0 else panel[30:, SIZE[0] // 2 :]
    return int((part == np.array(colour)).all(axis=2).sum())


def test_bars_tell_what_is_left(g1: RobotDescription) -> None:
    rig = Rig(g1)
    rig.tick(rig.q, motion=PROMISED)
    view = look(rig.robot)
    assert view is not None
    middle = (np.zeros(7), np.zeros(7))
    at_limit = (np.zeros(7), np.array([0.0, 0.0, 0.0, -1.0, 0.0, 0.95, 0.0]))
    well = draw_panel(replace(view, places=middle))
    bad = draw_panel(replace(view, places=at_limit))
    assert well.shape == (SIZE[1], SIZE[0], 3)
    assert counted(well, THERE, 0) == counted(well, THERE, 1) == counted(bad, THERE, 0) == 0
    assert counted(bad, THERE, 1) > 200
    assert counted(bad, NEAR, 1) > 200
    sizes = []
    for times in (9.0, 2.0, 0.5):
        motion = replace(view.motion, manipulability=np.array([times, 20.0]) * SINGULAR_TWIST)
        panel = draw_panel(replace(view, motion=motion, places=middle))
        sizes.append([counted(panel, colour, 0) for colour in (WELL, NEAR, THERE)])
        assert counted(panel, WELL, 1) == counted(well, WELL, 1)
    (well_9, _, _), (_, near_2, _), (_, _, there_half) = sizes
    assert well_9 > near_2 > there_half > 0


def test_the_limit_is_named(g1: RobotDescription) -> None:
    """The words differ with what limits, and are there only where something does."""
    rig = Rig(g1)
    rig.tick(rig.q, motion=PROMISED)
    view = look(rig.robot)
    assert view is not None

    def words(**fields) -> bytes:
        return draw_panel(replace(view, motion=replace(view.motion, **fields)))[-60:].tobytes()

    nothing = words()
    joint = words(limited_by=("joint", ""), limiting_joint=("left_elbow_joint", None))
    other = words(limited_by=("joint", ""), limiting_joint=("left_wrist_yaw_joint", None))
    right = words(limited_by=("", "collision"))
    assert len({nothing, joint, other, right}) == 4
