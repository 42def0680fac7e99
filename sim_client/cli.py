"""The command `ik-sim`: a simulated robot follows wrist targets through a running IK service.

MuJoCo is imported after the arguments are read, so that `--help` and mistakes are answered at once.
"""

import argparse
import signal
from collections.abc import Callable, Sequence
from pathlib import Path

from sim_client.extras import missing_extra

EXIT_OK, EXIT_USAGE = 0, 2

_ROBOT_ONLY = {"listen", "tls_cert", "tls_key", "tls_client_ca", "insecure", "eyes_to"}
"""Options of the robot alone."""

_EPILOG = """\
examples:
  ik-service serve                                     in one terminal, then in another:
  ik-sim                                               the default path, in a window if there is a display
  ik-sim --headless --path wave --video wave.mp4       without a window, with a film of it
  ik-sim --motion dance.npz --feed-forward             a recorded motion
  ik-sim --drag                                        drag the targets: double click, then Ctrl and right mouse button
  ik-sim zenoh://127.0.0.1:7447 --headless             over Zenoh
  ik-sim --listen 127.0.0.1:12346                      the robot alone: commands come over a link, from another process

exit codes:
  0  ran to the end, until Ctrl-C, or until the window was closed
  2  a wrong option, robot or motion file, or no service; one line says which
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        arguments: Command line without the program's name; None takes the process's own.

    Returns:
        The exit code, as `--help` documents.
    """
    options = vars(_parser().parse_args(arguments))
    return run_command("ik-sim", ("sim",), lambda: _simulate(options))


def run_command(name: str, extras: tuple[str, ...], command: Callable[[], object]) -> int:
    """Run a command of the simulator; a mistake becomes one line on standard error.

    Args:
        name: Its name.
        extras: Extras it needs.
        command: Does the work.

    Returns:
        The exit code.
    """
    from ik_client.command import fail

    fault = missing_extra(*extras)
    if fault:
        return fail(name, fault)
    from ik_client import IKError
    from sim_client.service_process import ServiceFailed

    signal.signal(signal.SIGTERM, _interrupt)
    try:
        command()
    except KeyboardInterrupt:
        return EXIT_OK
    # The errors of settings, paths, robots and motion files are ValueErrors of one line each.
    except (ValueError, IKError, ServiceFailed, OSError) as error:
        return fail(name, str(error))
    return EXIT_OK


def _simulate(options: dict) -> object:
    from rich.console import Console

    if "listen" in options:
        return _robot_only(options)
    from ik_client.access_options import AccessFiles
    from sim_client.session import run_session
    from sim_client.settings import Settings, SettingsError

    strays = _ROBOT_ONLY & options.keys()
    if strays:
        raise SettingsError(f"{_flag(min(strays))} goes with --listen only")
    access = AccessFiles.taken_from(options)
    return run_session(Settings(access=access, **options), Console())


def _robot_only(options: dict) -> None:
    from rich.console import Console

    from sim_client.robot_only import RobotSettings, run_robot
    from sim_client.settings import SettingsError

    options.pop("url")
    strays = options.keys() - _ROBOT_ONLY - {"token_file", "robot", "headless", "duration", "report"}
    if strays:
        raise SettingsError(f"{_flag(min(strays))} is of no use with --listen: the robot alone does what it is told")
    console = Console()
    run_robot(RobotSettings(**options), console, console if console.is_terminal else Console(stderr=True))


def _flag(name: str) -> str:
    return "--" + name.replace("_", "-")


def _interrupt(_signal: int, _frame: object) -> None:
    """SIGTERM ends a run as Ctrl-C does: with its report."""
    raise KeyboardInterrupt


def add_run_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that `ik-sim` and `ik-demo` share; those not given stay out of the result."""
    parser.add_argument("--robot", metavar="NAME|PATH", help="packaged robot, or a description beside its model (g1)")
    parser.add_argument("--headless", action="store_true", help="open no window, even if there is a display")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="ik-sim",
        description="Simulate a robot whose arms follow wrist targets through a running IK service, in real time: "
        "physics every 5 ms, a command every 20 ms. The base is held in space.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        argument_default=argparse.SUPPRESS,
    )
    parser.add_argument(
        "url", nargs="?", default="tcp://127.0.0.1:12345", metavar="URL", help="address of the service (%(default)s)"
    )
    add_run_options(parser)
    targets = parser.add_argument_group("where the targets come from (one of)").add_mutually_exclusive_group()
    targets.add_argument("--path", metavar="NAME", help="a scripted path: circles, reach or wave (circles)")
    targets.add_argument("--motion", metavar="FILE.npz", type=Path, help="recorded joints: q, fps, joint_names")
    targets.add_argument("--drag", action="store_true", help="markers dragged in the window")
    control = parser.add_argument_group("control")
    control.add_argument(
        "--feed-forward",
        action="store_true",
        help="add the service's gravity torque, so that the arms do not sag",
    )
    control.add_argument("--smooth", action="store_true", help="filter the answers as OpenWBT does: 0.4, 0.3, 0.2, 0.1")
    control.add_argument(
        "--max-velocity", metavar="RAD/S", type=float, help="largest velocity of a joint's command (3)"
    )
    control.add_argument(
        "--max-step",
        metavar="RAD",
        type=float,
        help="clip each joint's step per 20 ms tick instead, as OpenWBT does (0.04 is what its 0.01 rad per 5 ms step "
        "amounts to in its simulation); without bounds of acceleration and jerk",
    )
    control.add_argument(
        "--timeout", metavar="S", type=float, help="how long a tick waits for the service, less than 0.02 (0.01)"
    )
    control.add_argument(
        "--ramp", metavar="S", type=float, help="how long the robot's end takes to hand its arms over (2)"
    )
    control.add_argument(
        "--duration",
        metavar="S",
        type=float,
        help="simulated time to run (the motion's length; 14 s for a path without a window; else until it is closed)",
    )
    access = parser.add_argument_group("to be let in by a service that asks (docs/access.md)")
    access.add_argument(
        "--token-file",
        metavar="FILE",
        type=Path,
        help="file with the token; with --listen, the one that loops must show ($IK_TOKEN)",
    )
    access.add_argument("--ca", metavar="FILE", help="PEM authority of a tls:// service (the system's)")
    access.add_argument("--cert", metavar="FILE", help="PEM certificate of this client, for tls:// (none)")
    access.add_argument("--key", metavar="FILE", help="its PEM private key (none)")
    access.add_argument("--zenoh-config", metavar="FILE", help="Zenoh configuration in JSON5, for zenoh:// (none)")
    robot = parser.add_argument_group("the robot alone: no service, no targets; a loop elsewhere commands it")
    robot.add_argument("--listen", metavar="HOST:PORT", help="take commands there; port 0 lets the system choose")
    robot.add_argument("--tls-cert", metavar="FILE", type=Path, help="certificate of the robot (PEM), for TLS")
    robot.add_argument("--tls-key", metavar="FILE", type=Path, help="its private key (PEM)")
    robot.add_argument(
        "--tls-client-ca", metavar="FILE", type=Path, help="authorities that a loop's certificate must come from (PEM)"
    )
    robot.add_argument("--insecure", action="store_true", help="let other machines in without asking who they are")
    robot.add_argument(
        "--eyes-to",
        metavar="WHERE",
        help="show what its eyes see, 640x480 each, while somebody watches: shm for programs on this machine, "
        "zenoh://HOST:PORT where an IK service or a router listens, or off (shm)",
    )
    output = parser.add_argument_group("what to write, after the run")
    output.add_argument("--report", metavar="FILE.json", type=Path, help="all numbers of the run")
    output.add_argument("--video", metavar="FILE.mp4", type=Path, help="a film, 25 frames a second")
    output.add_argument("--still", metavar="FILE.png", type=Path, help="a strip of stills")
    output.add_argument("--eyes", metavar="DIR", type=Path, help="stereo pairs of 640x480, five a second")
    return parser
