"""`ik-camera`: options, mistakes in one line each, and what calibrate and record do."""

import time
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from painted_person import BENT, HEIGHT, SPREAD, WIDTH, limbs, look

from camera_client import calibrate as calibrating
from camera_client import cli, cockpit, session, setup
from camera_client import record as recording_command
from camera_client.calibration import CalibrationError, load
from camera_client.recording import Recording, RecordingError
from camera_client.robot_arms import robot_geometry
from camera_client.scaling import G1_ARMS
from camera_client.settings import Settings
from ik_client.command import EXIT_OK, EXIT_USAGE
from ik_client.devices import DeviceError
from ik_client.robot_end import RobotLink
from ik_client.start import SettingsError
from ik_proto.robots import RobotError, load_description


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"start": "slowly"}, "--start slowly: choose one of home, operator"),
        ({"speed": 0.0}, "--speed 0"),
        ({"speed": float("nan")}, "--speed nan"),
        ({"start_speed": 4.0}, "at most --speed"),
        ({"tilt": 80.0}, "--tilt 80"),
        ({"tilt": float("nan")}, "--tilt nan"),
        ({"field_of_view": 5.0}, "--fov 5"),
        ({"replay_speed": 0.0}, "--replay-speed 0"),
    ],
)
def test_options_that_make_no_run(options, words):
    with pytest.raises(SettingsError, match=words):
        Settings(**options)


@pytest.fixture
def quiet(monkeypatch, tmp_path):
    """No signal handlers, an empty home, no network of MediaPipe's."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.setattr("signal.signal", lambda *_: None)
    monkeypatch.setattr(session, "RobotLink", partial(RobotLink, connect_timeout=0.1))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--replay", "absent.ikcam"], "absent.ikcam cannot be read"),
        (["run", "--source", "absent.ikcam"], "absent.ikcam cannot be read"),
        (["--user", "ada"], "run ik-camera calibrate --user ada"),
        (["--user", "../ada"], "is no user name"),
        (["--speed", "99"], "--speed 99"),
        (["--report", "/proc/none/report.json"], "cannot be written"),
        (["calibrate", "--user", "ada", "--source", "absent.ikcam"], "absent.ikcam cannot be read"),
        (["calibrate", "--user", "ada", "--countdown", "-1"], "--countdown -1"),
        (["record", "out.ikcam", "--source", "absent.ikcam"], "absent.ikcam cannot be read"),
        (["record", "out.ikcam", "--duration", "0"], "--duration 0"),
    ],
)
@pytest.mark.usefixtures("quiet")
def test_a_mistake_is_one_line(arguments, words, capsys):
    assert cli.main(arguments) == EXIT_USAGE
    said = capsys.readouterr().err
    assert said.startswith("ik-camera: ")
    assert words in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("command", [[], ["run"], ["calibrate"], ["record"], ["models"]])
def test_help_teaches(command, capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main([*command, "--help"])
    assert ended.value.code == 0
    said = capsys.readouterr().out
    if not command or command == ["run"]:
        for part in ("examples:", "exit codes:", "ik-camera calibrate --user ada", "This is no safety function"):
            assert part in said


@pytest.mark.usefixtures("quiet")
def test_options_reach_the_run(monkeypatch):
    asked: list[Settings] = []

    def run(settings, *_, **__):
        asked.append(settings)
        raise SettingsError("enough")

    monkeypatch.setattr(session, "run", run)
    line = "--source webcam:1 --fov 70 --mirror --enable pad:a --enable pedal:/dev/x --no-preview --start operator"
    assert cli.main([*line.split(), "--tilt", "-5", "--token-file", "t", "--release"]) == EXIT_USAGE
    (settings,) = asked
    assert settings.what == "webcam:1"
    assert settings.field_of_view_rad == pytest.approx(np.radians(70.0))
    assert settings.enable == ("pad:a", "pedal:/dev/x")
    assert (settings.mirror, settings.preview, settings.start, settings.release) == (True, False, "operator", True)
    assert settings.access.token_file == "t"
    # A camera that looks down sees up tilted towards itself.
    up = setup.calibration_of(replace(settings, tilt=10.0)).up_camera
    assert np.allclose(up, [0.0, -np.cos(np.radians(10.0)), -np.sin(np.radians(10.0))])


@pytest.mark.usefixtures("quiet")
def test_the_models_are_named(monkeypatch, tmp_path, capsys):
    file = tmp_path / "pose.task"
    file.write_bytes(bytes(2_000_000))
    monkeypatch.setattr("camera_client.models.make_models", lambda: [file])
    assert cli.main(["models"]) == EXIT_OK
    assert f"{file} (2.0 MB)" in capsys.readouterr().out


def test_a_model_that_takes_long_is_explained(monkeypatch, tmp_path):
    said: list[str] = []
    monkeypatch.setattr(setup, "_SLOW", 0.01)
    end = time.monotonic() + 10.0

    def ensure(_name):
        while not said and time.monotonic() < end:
            time.sleep(0.001)
        return tmp_path

    monkeypatch.setattr(setup, "ensure_model", ensure)
    assert setup.model_file("full", said.append) == tmp_path
    assert said == ["making the pose model full, once; it is kept for the next time ..."]


def test_the_robots_arms_are_read_from_its_description(tmp_path):
    description = load_description("g1")
    arms = robot_geometry(description).arms
    for name in ("shoulders", "hint_origins", "axes"):
        assert np.allclose(getattr(arms, name), getattr(G1_ARMS, name), atol=1e-3), name
    assert (arms.upper, arms.fore) == pytest.approx((G1_ARMS.upper, G1_ARMS.fore), abs=1e-4)
    broken = tmp_path / "robot.xml"
    for text, words in (
        ("<mujoco>", "no MJCF model"),
        ("<mujoco/>", "has no joint or body"),
        ('<mujoco><body name="pelvis"><body name="a" euler="0 0 1"/></body></mujoco>', "turned by a quaternion"),
    ):
        broken.write_text(text)
        with pytest.raises(RobotError, match=words):
            robot_geometry(replace(description, model=broken))


def test_a_bent_waist_takes_the_shoulders_along():
    """Against MuJoCo."""
    mujoco = pytest.importorskip("mujoco")
    description = load_description("g1")
    geometry = robot_geometry(description)
    model = mujoco.MjModel.from_xml_path(str(description.model))
    data = mujoco.MjData(model)
    waist = np.array([0.4, -0.2, 0.3])
    for name, angle in zip(description.waist, waist, strict=True):
        data.qpos[model.joint(name).qposadr[0]] = angle
    mujoco.mj_kinematics(model, data)
    pelvis = data.body(description.base)
    R, p = pelvis.xmat.reshape(3, 3), pelvis.xpos
    bent = geometry.bent(waist)
    for side, arm in enumerate(description.arms):
        first, second = (data.joint(name) for name in arm.joints[:2])
        assert np.allclose(bent.hint_origins[side], (first.xanchor - p) @ R, atol=1e-9)
        assert np.allclose(bent.axes[side], first.xaxis @ R, atol=1e-9)
        assert np.allclose(bent.shoulders[side], (second.xanchor - p) @ R, atol=1e-9)
    assert geometry.bent(None) is geometry.arms
    assert geometry.bent(np.zeros(1)) is geometry.arms


class Posing:
    """A camera before somebody who poses, and the pose model, by a clock of their own."""

    description = "a camera"
    has_depth = True
    age = 0.0
    fault = ""
    held = None

    def __init__(self, pose, seconds: float = 60.0) -> None:
        self.now, self._pose, self._end = 100.0, pose, 100.0 + seconds
        self._found: Any = None
        self.closed = 0

    def clock(self) -> float:
        return self.now

    @property
    def finished(self) -> bool:
        return self.now >= self._end

    def next(self, _timeout: float):
        self.now += 1.0 / 30.0
        frame, self._found = look(self.now, self._pose(self.now - 100.0))
        return replace(frame, colour=np.zeros((HEIGHT, WIDTH, 3), np.uint8))

    def detect(self, _colour, _t):
        return self._found

    def close(self) -> None:
        self.closed += 1


@pytest.fixture
def calibrate(monkeypatch, tmp_path):
    """Calibrate somebody who poses; gives what was said."""

    def run(camera: Posing, keep_going=lambda: True, **options) -> list[str]:
        said: list[str] = []
        monkeypatch.setattr(calibrating, "open_source", lambda *_, **__: camera)
        monkeypatch.setattr(calibrating, "detector_of", lambda *_: camera)
        calibrating.calibrate("ada", said.append, keep_going, folder=tmp_path, clock=camera.clock, **options)
        return said

    return run


def test_a_t_pose_is_waited_for_and_kept(calibrate, tmp_path):
    camera = Posing(lambda t: SPREAD if t > 8.0 else BENT)
    said = calibrate(camera)
    assert said[0].startswith("a camera: stand 2 to 4 m before it")
    assert said[1:6] == ["5 ...", "4 ...", "3 ...", "2 ...", "1 ..."]
    assert "stretch both arms out to the sides, level with the shoulders" in said
    assert "hold still ..." in said
    assert camera.now - 100.0 == pytest.approx(8.0 + 0.5 + 2.0, abs=0.1)
    assert load("ada", tmp_path).lengths == pytest.approx(np.array([[0.29, 0.25], [0.29, 0.25]]), abs=0.02)
    assert said[-1].endswith("ik-camera --user ada")
    assert camera.closed >= 1


def test_a_t_pose_that_is_left_begins_anew(calibrate):
    camera = Posing(lambda t: SPREAD if 6.0 < t < 7.5 or t > 9.0 else BENT)
    calibrate(camera)
    assert camera.now - 100.0 == pytest.approx(9.0 + 2.5, abs=0.1)


@pytest.mark.parametrize(
    ("pose", "seconds", "words"),
    [
        (lambda t: BENT, 90.0, "no T pose within 30 s: stretch both arms out"),
        (lambda t: SPREAD, 6.0, "frames showed a T pose"),
    ],
)
def test_what_is_no_t_pose_keeps_nothing(calibrate, tmp_path, pose, seconds, words):
    with pytest.raises(CalibrationError, match=words):
        calibrate(Posing(pose, seconds))
    assert list(tmp_path.iterdir()) == []


def test_arms_that_wander_are_refused(calibrate, tmp_path):
    def pose(t):
        up = 0.3 * np.sin(3.0 * t)
        left, right = np.array([0.0, 1.0, up]), np.array([0.0, -1.0, up])
        return limbs((left, left), (right, right))

    with pytest.raises(CalibrationError, match="you moved by"):
        calibrate(Posing(pose))
    assert list(tmp_path.iterdir()) == []


def test_a_calibration_can_be_given_up(calibrate, tmp_path):
    camera = Posing(lambda t: SPREAD)
    with pytest.raises(CalibrationError, match="nothing was kept"):
        calibrate(camera, lambda: camera.now < 102.0)
    assert list(tmp_path.iterdir()) == []


def test_a_camera_without_depth_cannot_measure_anybody(calibrate):
    camera = Posing(lambda t: SPREAD)
    camera.has_depth = False
    with pytest.raises(SettingsError, match="use a depth camera"):
        calibrate(camera)


@pytest.fixture
def record(monkeypatch):
    """Record a camera; gives the number of frames and what was said."""

    def run(camera: Posing, file, keep_going=lambda: True, **options) -> tuple[int, list[str]]:
        said: list[str] = []
        monkeypatch.setattr(recording_command, "open_source", lambda *_: camera)
        return recording_command.record(file, said.append, keep_going, clock=camera.clock, **options), said

    return run


def test_a_recording_has_what_the_camera_saw(record, monkeypatch, tmp_path):
    file = tmp_path / "one.ikcam"
    camera = Posing(lambda t: BENT)
    # Slow enough for the disk, as a camera is.
    real = camera.next
    monkeypatch.setattr(camera, "next", lambda timeout: time.sleep(0.02) or real(timeout))
    count, said = record(camera, file, duration=0.5)
    assert said[0] == f"a camera into {file}; Ctrl-C ends it"
    kept = Recording(file)
    assert len(kept) == count > 3
    assert kept.meta.source == "a camera"
    assert {entry.held for entry in kept.entries} == {None}
    kept.close()


def test_a_recording_of_nothing_is_no_file(record, monkeypatch, tmp_path):
    camera = Posing(lambda t: BENT)
    monkeypatch.setattr(camera, "next", lambda timeout: None)
    monkeypatch.setattr(camera, "fault", "the cable is out")
    with pytest.raises(RecordingError, match="the cable is out: nothing was recorded"):
        record(camera, tmp_path / "one.ikcam", lambda: camera.clock() < 0.0)
    assert list(tmp_path.iterdir()) == []


class Window:
    """Devices with a window and a space bar, or without a display."""

    made: list["Window"]

    def __init__(self, window, title, *, display: bool = True) -> None:
        if window and not display:
            raise DeviceError("no display for a window (no screen)")
        self.has_window = window is not None
        self.keys: frozenset[str] = frozenset()
        self.pressed: frozenset[str] = frozenset()
        self.closed = False
        self.pads = ()
        self.pumps = 0
        self.shown = 0

    def knows_key(self, name: str) -> bool:
        return True

    def pump(self) -> None:
        self.pumps += 1

    def show(self, picture) -> None:
        self.shown += 1

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None


def open_cockpit(monkeypatch, *, display: bool = True, window: bool = True, switches=(), own_switch: bool = False):
    monkeypatch.setattr(cockpit, "Devices", partial(Window, display=display))
    return cockpit.Cockpit(switches, own_switch=own_switch, window=window, title="t", terminal=False)


def test_the_space_bar_is_the_switch_where_there_is_a_window(monkeypatch):
    ours = open_cockpit(monkeypatch)
    assert ours.has_window
    assert ours.enable is not None
    assert ours.attend(1.0) is False
    assert ours.enable.held(1.0) is False
    devices: Any = ours._devices
    devices.keys = frozenset({"space"})
    devices.pressed = frozenset({"space", "l"})
    assert ours.attend(2.0) is True
    assert ours.enable.held(2.0) is True
    assert "hold key:space" in ours.hint
    devices.closed = True
    assert ours.attend(3.0) is True
    assert ours.enable.held(3.0) is None
    assert ours.ended
    ours.close()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"display": False}, "a key as the hold-to-run switch needs a window: no display"),
        ({"window": False}, "--no-preview leaves no window for the space bar"),
        ({"window": False, "switches": ("key:a",)}, "key:a needs a window of ours"),
        ({"switches": ("foot",)}, "'foot' is no switch"),
        ({"switches": ("pad:nose",)}, "a pad has no button 'nose'"),
    ],
)
def test_a_switch_that_cannot_be_is_told(monkeypatch, options, words):
    with pytest.raises(ValueError, match=words):
        open_cockpit(monkeypatch, **options)


def test_without_a_display_a_pad_will_do_and_a_recording_needs_nothing(monkeypatch):
    ours = open_cockpit(monkeypatch, display=False, switches=("pad:right_shoulder",))
    assert not ours.has_window
    assert ours.enable is not None
    ours.attend(1.0)
    assert ours.enable.held(1.0) is None  # no pad is plugged in
    ours = open_cockpit(monkeypatch, display=False, own_switch=True)
    assert ours.enable is None
    assert ours.attend(1.0) is False


def test_escape_ends_the_run(monkeypatch):
    ours = open_cockpit(monkeypatch)
    devices: Any = ours._devices
    devices.pressed = frozenset({"escape"})
    ours.attend(1.0)
    assert ours.ended
