"""The command `ik-gamepad`: sticks move a robot's wrists by velocity, through an IK service.

What it needs is imported after the arguments are read, so that `--help` and mistakes are answered at once.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ik_client.access_options import AccessFiles, add_access_options
from ik_client.command import KeepGoing, run_command, run_reported, say

_PACKAGES = ("pygame", "rich", "hdrh", "ruckig")

_EPILOG = """\
examples:
  ik-service serve                              in one terminal
  ik-sim --listen 127.0.0.1:12346               in another: the robot
  ik-gamepad                                    in a third: the pad that is plugged in
  ik-gamepad --keyboard                         without a pad: keys in a small window
  ik-gamepad --list                             which pads are there
  ik-gamepad --hold pedal:/dev/input/event5     hold-to-run with the foot
  ik-gamepad --bounds 0.2:0.4,0:0.3,0.1:0.5     keep the hands in a box

controls            PlayStation       Xbox              keyboard
  hold to run       L1 (hold)         LB (hold)         space (hold)
  left hand         left stick        left stick        W S A D, R F: up, down
  right hand        right stick       right stick       I K J L, Y H: up, down
  both up, down     D-pad, R2, L2     D-pad, RT, LT
  one hand up       cross + stick     A + stick
  turn the hands    R1 + the same     RB + the same     left shift + the same
  faster, slower    D-pad right, left                   = -
  hand/pelvis axes  triangle          Y                 tab
  go home           square (hold)     X (hold)          G (hold)
  stop              circle            B                 X

environment:
  IK_TOKEN  secret of a service or robot that demands one

exit codes:
  0  ran until Ctrl-C, Escape, or until the window was closed
  2  a wrong option or file, no pad, no service or no robot; one line says which

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
    return run_command("ik-gamepad", "gamepad", _PACKAGES, lambda keep_going: _run(options, keep_going))


def _run(options: dict[str, Any], keep_going: KeepGoing) -> None:
    if options.pop("list", False):
        from gamepad_client.listing import list_pads

        for line in list_pads(options.get("pads")):
            say(line)
        return
    from dataclasses import replace

    from gamepad_client.layout import Layout, read_layout
    from gamepad_client.session import run
    from gamepad_client.settings import Settings

    access = AccessFiles.taken_from(options)
    mapping = options.pop("mapping", None)
    layout = Layout() if mapping is None else read_layout(mapping)
    if "hold" in options:
        layout = replace(layout, hold=options.pop("hold"))
    run_reported(run, Settings(access=access, layout=layout, **options), keep_going)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="ik-gamepad",
        description="Move a robot's wrists by velocity with a gamepad's sticks, while the hold-to-run button is held. "
        "Whatever is let go, unplugged or lost: the arms brake and hold.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        argument_default=argparse.SUPPRESS,
    )
    parser.add_argument("--service", metavar="URL", help="the IK service (tcp://127.0.0.1:12345)")
    parser.add_argument("--robot", metavar="URL", help="the robot's end (tcp://127.0.0.1:12346)")
    parser.add_argument("--rate", metavar="HZ", type=float, help="ticks of the loop in a second (250)")
    hand = parser.add_argument_group("from stick to hand")
    hand.add_argument("--speed", metavar="M/S", type=float, help="of a hand, with the stick at its edge (0.3)")
    hand.add_argument("--turn-speed", metavar="RAD/S", type=float, help="of turning a hand (0.8)")
    hand.add_argument("--dead-zone", metavar="X", type=float, help="way of a stick that counts as none, 0 to 1 (0.12)")
    hand.add_argument("--curve", metavar="X", type=float, help="exponent of the response: 1 is proportional (1.7)")
    hand.add_argument("--frame", choices=("pelvis", "hand"), help="whose axes the hands move along (pelvis)")
    hand.add_argument(
        "--bounds", metavar="BOX", help="box of the left wrist X0:X1,Y0:Y1,Z0:Z1 [m]; the right's mirrors it"
    )
    law = parser.add_argument_group("from hand to joints: the service's law")
    law.add_argument(
        "--law",
        choices=("adaptive", "fixed"),
        help="adaptive: damped only where it must be; fixed: the document's (adaptive)",
    )
    law.add_argument("--free", action="store_true", help="leave the hands' orientation free instead of holding it")
    law.add_argument(
        "--damping", metavar="X", type=float, help="of the fixed law, the largest of the adaptive one (0.05)"
    )
    law.add_argument("--max-speed", metavar="RAD/S", type=float, help="largest speed of a joint (1.5)")
    law.add_argument("--max-acceleration", metavar="RAD/S2", type=float, help="largest acceleration of a joint (12)")
    law.add_argument("--posture-gain", metavar="1/S", type=float, help="how fast spare joints lean to mid-range (0.5)")
    home = parser.add_argument_group("going home")
    home.add_argument("--home", metavar="FILE|zeros", help="TOML with joints by name [rad], others 0 (zeros)")
    home.add_argument("--home-gain", metavar="1/S", type=float, help="share of the way made in a second (2)")
    home.add_argument("--home-speed", metavar="RAD/S", type=float, help="largest speed of a joint on it (0.5)")
    device = parser.add_argument_group("devices")
    device.add_argument("--keyboard", action="store_true", help="keys in a small window instead of a pad")
    device.add_argument("--hold", metavar="SWITCH", help="hold-to-run: pad:BUTTON, key:NAME or pedal:FILE (see above)")
    device.add_argument("--mapping", metavar="FILE", type=Path, help="TOML that says which control does what")
    device.add_argument("--pads", metavar="FILE", type=Path, help="SDL mappings of pads that SDL does not know")
    device.add_argument("--list", action="store_true", help="list the pads that are there, and end")
    device.add_argument("--no-window", dest="window", action="store_false", help="a table in the terminal instead")
    session = parser.add_argument_group("the session")
    session.add_argument("--report", metavar="FILE.json", type=Path, help="write what was done, with all latencies")
    session.add_argument("--release", action="store_true", help="at the end, have the robot take its arms back")
    add_access_options(parser)
    return parser
