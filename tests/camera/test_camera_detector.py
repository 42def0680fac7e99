"""MediaPipe on rendered people whose joints are known; it is silent, stays at home, and says when it is not there."""

import os
import platform
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from choreography import FULL, POSTURES, Choreography
from filmed import posed, shot
from rendered_person import INTRINSICS, WIDTH

from camera_client.detector import PoseDetector
from camera_client.landmarks import ARMS, HIPS, TRACKED, Landmarks
from camera_client.models import ModelError
from camera_client.pose_library import NoMediaPipe, mediapipe


@dataclass
class Look:
    """What a model found of one posture, and what is true."""

    colour: np.ndarray
    found: Landmarks
    pixels: np.ndarray
    joints: np.ndarray

    @property
    def errors(self) -> np.ndarray:
        """Of the tracked joints [pixel]."""
        return np.linalg.norm(self.found.pixels[TRACKED] - self.pixels, axis=1)


def still(posture: str) -> Choreography:
    return Choreography(((0.0, posture, posture), (1.0, posture, posture)), (0.0, 0.0), (0.0, 0.0))


@pytest.fixture
def detector(pose_model) -> Iterator[PoseDetector]:
    made = PoseDetector(pose_model)
    yield made
    made.close()


@pytest.fixture(scope="module")
def looks(scene, pose_model) -> dict[str, Look]:
    """Every posture, at the second sight of it: a model that follows needs one to get there."""
    detector = PoseDetector(pose_model)
    out = {}
    for second, name in enumerate(POSTURES):
        colour = shot(scene, still(name), 0.0).colour
        assert colour is not None
        _, p = posed(scene, still(name), 0.0)
        joints = scene.in_camera(scene.person.joints(p))
        assert detector.detect(colour, second) is not None, name
        found = detector.detect(colour, second + 0.033)
        assert found is not None, name
        out[name] = Look(colour, found, INTRINSICS.project(joints), joints)
    detector.close()
    return out


def test_joints_are_where_they_are(looks):
    """4.5 pixels in the mean is what was measured of this model on this person."""
    errors = np.array([look.errors for look in looks.values()])
    assert errors.mean() <= 5.0
    assert np.percentile(errors, 95) <= 12.0


def test_left_is_left(looks):
    """In a T pose nobody can take one hand for the other. Mirrored, left and right change places."""
    look = looks["T"]
    assert look.errors.max() < 0.1 * abs(look.pixels[2, 0] - look.pixels[5, 0])
    assert look.found.credible(*look.colour.shape[1::-1])


def test_a_mirrored_picture_swaps_left_and_right(looks, detector):
    look = looks["T"]
    mirrored = detector.detect(look.colour[:, ::-1], 0.0)
    assert mirrored is not None
    left, right = mirrored.pixels[TRACKED[2]], mirrored.pixels[TRACKED[5]]
    true_left, true_right = (np.array([WIDTH - 1 - x, y]) for x, y in look.pixels[[2, 5]])
    assert np.linalg.norm(left - true_right) < 20.0
    assert np.linalg.norm(right - true_left) < 20.0


def test_swapped_colours_are_worse(looks, pose_model):
    """The published chain gave blue for red."""
    swapped, right = [], []
    detector = PoseDetector(pose_model)
    for second, look in enumerate(looks.values()):
        detector.detect(look.colour[:, :, ::-1], second)
        found = detector.detect(look.colour[:, :, ::-1], second + 0.033)
        assert found is not None
        swapped.append(np.linalg.norm(found.pixels[TRACKED] - look.pixels, axis=1))
        right.append(look.errors)
    detector.close()
    assert np.mean(swapped) > 1.05 * np.mean(right)


@pytest.mark.parametrize("posture", POSTURES)
def test_the_body_in_3d_has_the_axes_of_the_optical_frame(looks, posture):
    """Limbs point where they do within 35 degrees, a model's guess; a flipped axis is off by far more, see below."""
    look = looks[posture]
    assert look.found.world is not None
    world, true = look.found.world[TRACKED], look.joints
    assert angles(world, true).max() < 35.0
    assert np.abs(world[HIPS].mean(axis=0)).max() < 0.02


@pytest.mark.parametrize("axis", range(3))
def test_each_axis_is_told_apart_by_some_posture(looks, axis):
    flip = np.ones(3)
    flip[axis] = -1.0
    worst = max(angles(look.found.world[TRACKED] * flip, look.joints).max() for look in looks.values())
    assert worst > 90.0


def angles(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Between the limbs of the arms [degree]."""

    def limbs(joints: np.ndarray) -> np.ndarray:
        limbs = np.diff(joints[ARMS].reshape(2, 3, 3), axis=1)
        return limbs / np.linalg.norm(limbs, axis=2, keepdims=True)

    return np.degrees(np.arccos(np.clip((limbs(a) * limbs(b)).sum(axis=2), -1.0, 1.0)))


def test_nobody_is_none(scene, detector):
    u, f, *_ = FULL.at(0.0)
    away = scene.person.pose(u, f, shift=np.array([0.0, 50.0, 1.0]))
    empty, _ = scene.render(*away)
    assert detector.detect(empty, 0.0) is None
    assert detector.detect(np.zeros_like(empty), 0.033) is None


def test_who_goes_is_forgotten(scene, looks, detector):
    assert detector.detect(looks["T"].colour, 0.0) is not None
    blank = np.zeros_like(looks["T"].colour)
    assert [detector.detect(blank, t) for t in (0.033, 0.067, 0.1)][-1] is None


def test_a_time_that_does_not_grow_is_no_error(looks, detector):
    """MediaPipe refuses times that do not grow by a millisecond; a camera's may."""
    colour = looks["T"].colour
    for t_capture in (0.0, 0.0, 5.0, 5.0004, 5.0004, 4.0, -3.0):
        assert detector.detect(colour, t_capture) is not None


def test_closing_twice_does_no_harm(pose_model):
    detector = PoseDetector(pose_model)
    detector.close()
    detector.close()


def test_what_is_no_model_is_one_line(tmp_path):
    file = tmp_path / "mine.task"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("pose_detector.tflite", b"nonsense")
        archive.writestr("pose_landmarks_detector.tflite", b"nonsense")
    with pytest.raises(ModelError, match=r"mine\.task is no pose landmarker") as caught:
        PoseDetector(file)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("machine", "said"), [("x86_64", r"ik-service\[camera\]"), ("aarch64", "x86-64 computer")])
def test_without_mediapipe_it_says_what_to_do(monkeypatch, machine, said):
    monkeypatch.setitem(sys.modules, "mediapipe", None)
    monkeypatch.setattr(platform, "system", lambda: "Linux")
    monkeypatch.setattr(platform, "machine", lambda: machine)
    with pytest.raises(NoMediaPipe, match=said) as caught:
        mediapipe()
    assert "\n" not in str(caught.value)


WATCH = """
import sys

import numpy as np

def watch(event, arguments):
    if event in ("socket.connect", "socket.getaddrinfo", "socket.gethostbyname", "socket.sendto"):
        raise SystemExit(f"{event} {arguments}")

sys.addaudithook(watch)
from pathlib import Path

import camera_client.detector
from camera_client.detector import PoseDetector

if "loud" in sys.argv:
    from contextlib import nullcontext
    camera_client.detector._silence = nullcontext
if "network" in sys.argv:
    sys.path.insert(0, str(Path(sys.argv[3]).parent))
    import call_home
detector = PoseDetector(Path(sys.argv[1]))
colour = np.load(sys.argv[2])
found = [detector.detect(colour, t / 30) is not None for t in range(5)]
detector.close()
assert all(found)
for line in Path("/proc/net/snmp").read_text().splitlines():
    if "count" in sys.argv and line.startswith(("Tcp", "Udp:", "Ip:")):
        print(line)
"""


@pytest.fixture
def watch(tmp_path, pose_model, looks):
    """Runs a detector on a person in a process that stops at a connection that Python makes."""
    picture = tmp_path / "picture.npy"
    np.save(picture, looks["T"].colour)

    def run(*arguments: str, before: tuple[str, ...] = ()) -> subprocess.CompletedProcess[str]:
        command = [*before, sys.executable, "-c", WATCH, str(pose_model), str(picture), *arguments]
        return subprocess.run(command, capture_output=True, text=True, timeout=60)

    return run


def test_nothing_is_said_and_no_connection_is_tried_from_python(watch):
    done = watch()
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_mediapipe_would_talk_if_it_were_let(watch):
    """The negative control of silence."""
    done = watch("loud")
    assert done.returncode == 0
    assert done.stderr.count("\n") >= 3


def attempts(output: str) -> int:
    """Connections and packets that a network namespace of one process counted, whether or not they had a way out."""
    lines = [line.split() for line in output.splitlines()]
    count = 0
    for names, values in zip(lines[::2], lines[1::2], strict=True):
        assert names[0] == values[0]
        counted = dict(zip(names[1:], map(int, values[1:]), strict=True))
        count += sum(counted.get(name, 0) for name in ("ActiveOpens", "OutDatagrams", "OutRequests", "OutNoRoutes"))
    return count


def alone() -> tuple[str, ...]:
    """A command that starts another one without a network; skips the test where that is not allowed."""
    command = ("unshare", "--net") if os.geteuid() == 0 else ("unshare", "--map-root-user", "--net")
    if shutil.which("unshare") is None or subprocess.run([*command, "true"], capture_output=True).returncode:
        pytest.skip("a process cannot be given a network of its own here")
    return command


def test_no_connection_is_tried_from_below_python_either(watch):
    done = watch("count", before=alone())
    assert done.returncode == 0, done.stderr
    assert attempts(done.stdout) == 0


def test_a_look_up_would_be_counted(tmp_path, watch):
    """The negative control: what a newer MediaPipe does, by the C library and past Python's audit."""
    (tmp_path / "call_home.py").write_text(
        "import ctypes\nlibc = ctypes.CDLL(None)\n"
        "fd = libc.socket(2, 2, 0)\n"
        "address = bytes([2, 0, 0, 53, 192, 0, 2, 1]) + bytes(8)\n"
        "libc.sendto(fd, b'x', 1, 0, address, 16)\n"
    )
    done = watch(str(tmp_path / "call_home.py"), "network", "count", before=alone())
    assert done.returncode == 0, done.stderr
    assert attempts(done.stdout) > 0
