"""The command `ik-xr`: hands in a headset, or in a recording, move a robot's arms through an IK service.

What it needs is imported after the arguments are read, so that `--help` and mistakes are answered at once.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

_PACKAGES = ("aiohttp", "cryptography", "segno", "hdrh", "ruckig")
_NETWORK = {"host", "port", "names", "certificates"}
"""Options that only make sense where the page is served to others."""

_EPILOG = """\
examples:
  ik-service serve                              in one terminal
  ik-sim --listen 127.0.0.1:12346               in another: the robot
  ik-xr                                         in a third; open the URL it prints in the headset
  ik-xr --arm-length 0.58                       your stretched arm is the robot's stretched arm
  ik-xr --local-only                            for a headset on a USB cable: no certificates
  ik-xr --emulate                               without a headset: mouse and keys in a browser on this machine
  ik-xr --record monday.ikxr                    keep the session
  ik-xr --replay monday.ikxr                    play it again, without a headset

in the headset, the first time:
  1. open the printed https address, or scan the QR code with the headset's camera
  2. install ca.crt from the printed address, so that the browser trusts this machine; a USB cable needs none of it
  3. press Enter VR, hold your hands as the robot's arms are, and grip: the arms follow until you let go

environment:
  IK_TOKEN  secret of a service or robot that demands one

exit codes:
  0  ran to the end of the recording, or until Ctrl-C
  2  a wrong option or file, a port that is taken, no service or no robot; one line says which

This is no safety function: keep the robot's own emergency stop within reach.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        arguments: Command line without the program's name; None takes the process's own.

    Returns:
        The exit code, as `--help` documents.
    """
    options = vars(_parser().parse_args(arguments))
    from ik_client.command import run_command

    return run_command("ik-xr", "xr", _PACKAGES, lambda keep_going: _run(options, keep_going))


def _run(options: dict[str, Any], keep_going: Callable[[], bool]) -> None:
    from ik_client.command import run_reported
    from xr_client.session import run
    from xr_client.settings import Settings

    if "names" in options:
        options["names"] = tuple(options["names"])
    # An emulated headset is in a browser on this machine; who names a port wants real ones too.
    if "emulate" in options and not options.keys() & _NETWORK:
        options["local_only"] = True
    run_reported(run, Settings(**options), keep_going)


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
    page.add_argument("--host", metavar="ADDRESS", help="address to serve it at with TLS (0.0.0.0: all; ::, IPv6 too)")
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
    session.add_argument(
        "--emulate",
        action="store_true",
        help="try it without a headset: a browser on this machine opens the page with an emulated one; implies "
        "--local-only unless --host, --port, --name or --certificates is given; needs npm, once",
    )
    session.add_argument(
        "--video",
        metavar="SOURCE",
        help="the robot's eye images: auto takes what the robot names, off shows none, or shm:NAME, zenoh://HOST:PORT "
        "(auto)",
    )
    session.add_argument("--report", metavar="FILE.json", type=Path, help="write what was done, with all latencies")
    session.add_argument("--release", action="store_true", help="at the end, have the robot take its arms back")
    return parser
