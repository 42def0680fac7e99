"""Makes the pictures of the camera client for the docs: the preview, and a person beside the robot that mirrors them.

    python benchmarks/camera_pictures.py [docs/images]

A rendered person is recorded, and the recording played to `ik-camera`, a service and a simulated robot, all of them
real. The robot is drawn as its joints were measured while the person stood still. Needs the data with which the camera
client is tested (IK_DATA, else ../shared/data).
"""

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from benchmarks.load.processes import child, first_line
from benchmarks.rendered import REPO, person_folder, rendered
from camera_client import session
from camera_client.board import Shown
from camera_client.preview import Preview
from camera_client.settings import Settings
from ik_client.arm_joints import SIDES
from ik_proto.robots import load_description
from sim_client.offscreen import Offscreen, free_camera
from sim_client.robot import SimRobot

_TITLES = {"T": "T pose", "reach": "forward reach", "raised": "one arm raised"}
_TALL = 400
"""Height of a picture in the pair [pixel]."""
_WIDE = 440
_SPEED = 0.5
"""How fast the recording is played: drawing takes its share of the processor."""

_AWAY = np.eye(4)
_AWAY[2, 3] = -9.0
"""Where nobody sees the marks of targets; there are none here."""

Picture = NDArray[np.uint8]


def main() -> int:
    """Make both pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=REPO / "docs" / "images", help="where to (docs/images)")
    folder = parser.parse_args().folder
    person = person_folder()
    if person is None:
        print("camera_pictures: no person to film: set IK_DATA to the folder of the test data", file=sys.stderr)
        return 2
    rig = rendered("mirror_rig")
    seen: list[tuple[float, Picture, Picture]] = []
    preview = Preview()

    def watch(shown: Shown) -> None:
        if shown.look is not None and shown.look.frame.colour is not None:
            picture = preview.draw(shown, "hold key:space; L: next operator; Esc: end").copy()
            seen.append((shown.look.captured, shown.look.frame.colour, picture))

    serving = ["-m", "ik_service", "serve", "--tcp", "127.0.0.1:0", "--zenoh", "off", "--http", "off"]
    simulated = ["-m", "sim_client", "--listen", "127.0.0.1:0", "--headless", "--eyes-to", "off"]
    everywhere = os.sched_getaffinity(0)
    with tempfile.TemporaryDirectory() as name:
        recording = Path(name) / "quick.ikcam"
        with rendered("scenes").open_scene(person) as scene:
            rendered("filmed").film(recording, scene, rig.QUICK, lambda t: t >= rig.PRESS, fps=25.0)
        with child([*serving, "--log-format", "json"], everywhere) as served, child(simulated, everywhere) as robot_end:
            service = f"tcp://{json.loads(first_line(served, 'the service'))['tcp']}"
            url = f"tcp://{json.loads(first_line(robot_end, 'the robot'))['listen']}"
            settings = Settings(service=service, robot=url, replay=recording, replay_speed=_SPEED, preview=False)
            with rig.Watcher(url) as watcher:
                report = session.run(settings, print, terminal=False, keep_going=lambda: True, watch=watch)
    first, limbs, pairs = report.document()["frames"]["first"], rig.Limbs(), []
    for posture, (begin, end) in rig.STILL.items():
        then = first + (end - 0.1) / _SPEED
        _, picture, shown = min(seen, key=lambda one: abs(one[0] - then))
        measured = min(watcher.seen, key=lambda one: abs(one.time - then))
        still = watcher.between(first + begin / _SPEED, first + end / _SPEED)
        robot = np.median([limbs.directions(one) for one in still], axis=0)
        far = rig.angles(robot, rig.person_directions(rig.QUICK, 0.5 * (begin + end)))
        for side, (upper, fore) in zip(SIDES, far, strict=True):
            print(f"{posture}: {side} upper arm {upper:.1f}, forearm {fore:.1f} degrees off")
        pairs.append((_TITLES[posture], picture, measured))
        if posture == "raised":
            Image.fromarray(shown).save(folder / "camera_preview.png", optimize=True)
    _side_by_side(pairs).quantize(192).save(folder / "camera.png", optimize=True)
    return 0


def _side_by_side(pairs: list) -> Image.Image:
    """Persons above, robots below, a posture in a column."""
    description = load_description("g1")
    robot = SimRobot(description)
    canvas = Image.new("RGB", (len(pairs) * _WIDE, 2 * _TALL), (25, 32, 42))
    pen, font = ImageDraw.Draw(canvas), ImageFont.load_default(18)
    with Offscreen(robot.model) as offscreen:
        for column, (title, person, measured) in enumerate(pairs):
            for name, angle in zip(description.arm_joints, measured.q, strict=True):
                robot.data.qpos[robot.model.joint(name).qposadr[0]] = angle
            mujoco.mj_forward(robot.model, robot.data)
            robot.show_targets(_AWAY, _AWAY)
            mujoco.mj_forward(robot.model, robot.data)
            shoulders = np.mean([robot.data.joint(arm.joints[0]).xanchor for arm in description.arms], axis=0)
            camera = free_camera(shoulders - [0.0, 0.0, 0.02], 1.7, 180.0, -4.0)
            drawn = Image.fromarray(offscreen.image(robot.data, camera, _WIDE, _TALL))
            height = person.shape[0]
            width = round(height * _WIDE / _TALL)
            left = (person.shape[1] - width) // 2
            seen = Image.fromarray(np.ascontiguousarray(person[:, left : left + width])).resize((_WIDE, _TALL))
            canvas.paste(seen, (column * _WIDE, 0))
            canvas.paste(drawn, (column * _WIDE, _TALL))
            pen.text((column * _WIDE + 10, 8), title, font=font, fill=(20, 24, 30))
    return canvas


if __name__ == "__main__":
    sys.exit(main())
