"""The command `ik-xr`: hands in a headset, or in a recording, move a robot's arms through an IK service.

What it needs is imported after the arguments are read, so that `--help` and mistakes are answered at once.
"""

import argparse
import signal
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

EXIT_OK, EXIT_USAGE = 0, 2
_PACKAGES = ("aiohttp", "cryptography", "segno", "ruckig")

_EPILOG = """\
examples:
  ik-service serve                              in one terminal
  ik-sim --listen 127.0.0.1:12346               in another: the robot
  ik-xr                                         in a third; open the URL it prints in the headset
  ik-xr --arm-length 0.58                       your stretched arm is the robot's stretched arm
  ik-xr --local-only                            for a headset on a USB cable: no certificates
  ik-xr --record monday.ikxr                    keep the session
  ik-xr --replay monday.ikxr                    play it again, without a headset

environment:
  IK_TOKEN  secret of a service or robot that demands one

exit codes:
  0  ran to the end of the recording, or until Ctrl-C
  2  a wrong option or file, a port that is taken, no service or no robot; one line says which
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        arguments: Command line without the program's name; None takes the process's own.

    Returns:
        The exit code, as `--help` documents.
    """
    options = vars(_parser().parse_args(arguments))
    missing = [name for name in _PACKAGES if find_spec(name) is None]
    if missing:
        return _fail(f"package {missing[0]} is missing: pip install 'ik-service[xr]'")
    from ik_client.errors import IKError
    from xr_client.session import run
    from xr_client.settings import Settings

    ended: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _frame: ended.append(number))
    try:
        if "names" in options:
            options["names"] = tuple(options["names"])
        summary = run(Settings(**options), _say, terminal=sys.stdout.isatty(), keep_going=lambda: not ended)
    # The errors of settings, certificates, ports, recordings and calibration are ValueErrors of one line each.
    except (ValueError, IKError, OSError) as error:
        return _fail(" ".join(str(error).split()))
    share = summary.active / max(summary.ticks, 1)
    _say(
        f"{summary.ticks} ticks, {summary.late} of them late; {summary.engagements} engagements, "
        f"an arm followed in {share:.0%} of the time"
    )
    return EXIT_OK


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="ik-xr",
        description="Serve a page to a headset, and let the robot's arms follow the hands that grip. Each arm follows "
        "while its controller is squeezed, or thumb and index finger are pinched, and holds otherwise.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        argument_default=argparse.SUPPRESS,
    )
    parser.add_argument("--service", metavar="URL", help="the IK service (tcp://127.0.0.1:12345)")
    parser.add_argument("--robot", metavar="URL", help="the robot's end (tcp://127.0.0.1:12346)")
    parser.add_argument("--ca", metavar="FILE", type=Path, help="authority of a tls:// service or robot (PEM)")
    page = parser.add_argument_group("the page")
    page.add_argument("--host", metavar="ADDRESS", help="address to serve it at with TLS (0.0.0.0: all)")
    page.add_argument("--port", metavar="PORT", type=int, help="its port (8443)")
    page.add_argument("--local-port", metavar="PORT", type=int, help="port for http on this machine only (8080)")
    page.add_argument("--local-only", action="store_true", help="serve it on this machine only")
    page.add_argument(
        "--name", metavar="HOST", dest="names", action="append", help="another name or address of this machine; repeat"
    )
    page.add_argument(
        "--certificates", metavar="DIR", type=Path, help="folder of the private authority (~/.config/ik-xr)"
    )
    hands = parser.add_argument_group("from hand to arm")
    hands.add_argument(
        "--reference",
        metavar="NAME",
        help="standing: relative to the grip; openwbt: absolute, from the head (standing)",
    )
    hands.add_argument("--scale", metavar="X", type=float, help="way of the wrist over way of the hand (1)")
    hands.add_argument("--arm-length", metavar="M", type=float, help="your arm from shoulder to wrist: sets the scale")
    hands.add_argument(
        "--neck", metavar="FILE", type=Path, help="recording of you looking around: then walking moves no arm"
    )
    session = parser.add_argument_group("the session")
    session.add_argument("--record", metavar="FILE.ikxr", type=Path, help="keep what the headset sends")
    session.add_argument("--replay", metavar="FILE", type=Path, help="play a recording (.ikxr or .npz) instead")
    session.add_argument("--release", action="store_true", help="at the end, have the robot take its arms back")
    return parser


def _say(line: str) -> None:
    print(line, flush=True)


def _fail(message: str) -> int:
    print(f"ik-xr: {message}", file=sys.stderr)
    return EXIT_USAGE
