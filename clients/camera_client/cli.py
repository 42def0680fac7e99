"""The command `ik-camera`: arms before a camera, or in a recording, move a robot's arms through an IK service.

What it needs is imported after the arguments are read, so that `--help` and mistakes are answered at once.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ik_client.access_options import AccessFiles, add_access_options
from ik_client.command import KeepGoing, run_command, run_reported, say

_PACKAGES = ("mediapipe", "cv2", "pygame", "rich", "hdrh", "ruckig")

_EPILOG = """\
examples:
  ik-service serve                            in one terminal
  ik-sim --listen 127.0.0.1:12346             in another: the robot
  ik-camera calibrate --user ada              in a third, once: hold a T pose for two seconds
  ik-camera --user ada                        then: hold the space bar, and the robot mirrors your arms
  ik-camera --enable pad:right_shoulder       hold a gamepad's button instead of the space bar
  ik-camera --enable pedal:/dev/input/event5  or a foot pedal
  ik-camera --source webcam:0                 a camera without depth: about four times less exact
  ik-camera record monday.ikcam               keep what the camera sees
  ik-camera --replay monday.ikcam             play it again, without a camera
  ik-camera models                            make all pose models now, while there is a network

ik-camera run --help lists the options of what it does without a command.

environment:
  IK_TOKEN  secret of a service or robot that demands one

exit codes:
  0  ran to the end of the recording, or until Ctrl-C, Esc or the window was closed
  2  a wrong option or file, no camera, no service or no robot; one line says which

This is no safety function: keep the robot's own emergency stop within reach.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        arguments: Command line without the program's name; None takes the process's own.

    Returns:
        The exit code, as `--help` documents.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not (words and (words[0] in _DO or words[0] in ("-h", "--help"))):
        words.insert(0, "run")
    options = vars(_parser().parse_args(words))
    do = _DO[options.pop("command")]
    return run_command("ik-camera", "camera", _PACKAGES, lambda keep_going: do(options, keep_going))


def _run(options: dict[str, Any], keep_going: KeepGoing) -> None:
    from camera_client.session import run
    from camera_client.settings import Settings

    if "enable" in options:
        options["enable"] = tuple(options["enable"])
    options["access"] = AccessFiles.taken_from(options)
    run_reported(run, Settings(**options), keep_going)


def _calibrate(options: dict[str, Any], keep_going: KeepGoing) -> None:
    from camera_client.calibrate import calibrate

    calibrate(say=say, keep_going=keep_going, **options)


def _record(options: dict[str, Any], keep_going: KeepGoing) -> None:
    from camera_client.record import record

    record(say=say, keep_going=keep_going, **options)


def _models(_options: dict[str, Any], _keep_going: KeepGoing) -> None:
    from camera_client.models import make_models

    say("making the pose models lite, full and heavy ...")
    for file in make_models():
        say(f"{file} ({file.stat().st_size / 1e6:.1f} MB)")


_DO = {"run": _run, "calibrate": _calibrate, "record": _record, "models": _models}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="ik-camera",
        description="Stand before a depth camera, and the robot mirrors your arms while you hold a switch. It holds\n"
        "its arms otherwise, and whenever an arm is out of view, a frame is late, or somebody else steps in.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="command")
    _run_options(_command(commands, "run", "let the robot mirror your arms"))
    fit = _command(commands, "calibrate", "fit your limbs and the camera's tilt, in two seconds of a T pose")
    fit.add_argument("--user", metavar="NAME", required=True, help="the name to keep it under")
    _camera_options(fit)
    fit.add_argument("--replay", metavar="FILE", type=Path, help="calibrate on a recording instead of a camera")
    fit.add_argument("--countdown", metavar="S", type=float, help="time to take the pose (5)")
    keep = _command(commands, "record", "keep what the camera sees, until Ctrl-C")
    keep.add_argument("file", metavar="FILE.ikcam", type=Path, help="the recording")
    keep.add_argument("--source", metavar="SOURCE", help="the camera, as for run (oak)")
    keep.add_argument("--duration", metavar="S", type=float, help="stop after this time")
    keep.add_argument(
        "--enable", metavar="SWITCH", action="append", help="keep also whether this switch is held; repeat"
    )
    _command(commands, "models", "make all pose models, so that later no network is needed")
    return parser


def _command(commands: Any, name: str, words: str) -> argparse.ArgumentParser:
    return commands.add_parser(
        name,
        help=words,
        description=f"{words[0].upper()}{words[1:]}.",
        epilog=_EPILOG if name == "run" else None,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        argument_default=argparse.SUPPRESS,
    )


def _camera_options(parser: argparse._ActionsContainer) -> None:
    parser.add_argument(
        "--source", metavar="SOURCE", help="oak, oak:ID, webcam:0, webcam:/dev/video2, or a recording (oak)"
    )
    parser.add_argument("--model", metavar="MODEL", help="lite, full, heavy, or the path of a .task file (full)")
    parser.add_argument("--fov", metavar="DEG", dest="field_of_view", type=float, help="a webcam's, across (60)")


def _run_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--service", metavar="URL", help="the IK service (tcp://127.0.0.1:12345)")
    parser.add_argument("--robot", metavar="URL", help="the robot's end (tcp://127.0.0.1:12346)")
    seen = parser.add_argument_group("what is seen")
    _camera_options(seen)
    seen.add_argument("--replay", metavar="FILE", type=Path, help="play a recording; its switch plays along")
    seen.add_argument("--replay-speed", metavar="X", type=float, help="how many times faster it is played (1)")
    seen.add_argument("--user", metavar="NAME", help="take the calibration of this name")
    seen.add_argument("--tilt", metavar="DEG", type=float, help="how far the camera looks down (as calibrated, or 0)")
    operation = parser.add_argument_group("operation")
    operation.add_argument(
        "--enable",
        metavar="SWITCH",
        action="append",
        help="what is held to run: key:NAME of the preview's window, pad:BUTTON, pedal:DEVICE; repeat (key:space)",
    )
    operation.add_argument(
        "--mirror", action="store_true", help="as in a mirror: the robot's left arm does what your right arm does"
    )
    operation.add_argument(
        "--start", metavar="WAY", help="home: go home first, then to your posture; operator: straight (home)"
    )
    operation.add_argument(
        "--start-speed", metavar="RAD/S", type=float, help="largest speed of a joint until an arm follows (0.5)"
    )
    operation.add_argument("--speed", metavar="RAD/S", type=float, help="largest speed of a joint (3)")
    operation.add_argument("--no-preview", dest="preview", action="store_false", help="open no window")
    operation.add_argument("--report", metavar="FILE.json", type=Path, help="write what was done, with all latencies")
    operation.add_argument("--release", action="store_true", help="at the end, have the robot take its arms back")
    add_access_options(parser)
