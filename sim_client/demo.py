"""The command `ik-demo`: everything at once, on one machine.

Starts the service as a child process, lets a simulated robot follow a scripted path through it, shows live numbers, and
leaves a report, a picture and a film.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from sim_client.cli import add_run_options, run_command

OUTAGE_TIME = 1.0
"""How long after a kill the service is started again [s]."""

_EPILOG = """\
examples:
  ik-demo                              14 seconds, then report and pictures in out/demo
  ik-demo --kill                       the service is killed on the way and restarted: the robot holds and resumes
  ik-demo --path wave --duration 30

exit codes:
  0  ran to the end, or until Ctrl-C
  2  a wrong option or robot, or the service did not start; one line says which
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        arguments: Command line without the program's name; None takes the process's own.

    Returns:
        The exit code, as `--help` documents.
    """
    options = vars(_parser().parse_args(arguments))
    return run_command("ik-demo", ("sim", "service"), lambda: _demonstrate(options))


def _demonstrate(options: dict) -> None:
    from rich.console import Console

    from sim_client.outage import Outage
    from sim_client.service_process import ServiceProcess
    from sim_client.session import run_session
    from sim_client.settings import SCRIPT_DURATION, Settings

    console = Console()
    folder: Path = options.pop("out", Path("out/demo"))
    kill = options.pop("kill", False)
    duration = options.setdefault("duration", SCRIPT_DURATION)
    console.print("starting the service", highlight=False)
    with ServiceProcess(options.get("robot", "g1"), folder / "service.log") as service:
        settings = Settings(
            url=service.url,
            report=folder / "report.json",
            still=folder / "demo.png",
            video=folder / "demo.mp4",
            **options,
        )
        outage = [Outage(service, duration / 3.0, duration / 3.0 + OUTAGE_TIME)] if kill else []
        run_session(settings, console, outage)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="ik-demo",
        description="Start the IK service and a simulated robot that follows a scripted path through it.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        argument_default=argparse.SUPPRESS,
    )
    add_run_options(parser)
    parser.add_argument(
        "--feed-forward",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="add the gravity torque that the service computes (on)",
    )
    parser.add_argument("--path", metavar="NAME", help="circles, reach or wave (circles)")
    parser.add_argument("--duration", metavar="S", type=float, help="simulated time to run (14)")
    parser.add_argument("--kill", action="store_true", help="kill the service on the way, and restart it")
    parser.add_argument("--out", metavar="DIR", type=Path, help="where report and pictures go (out/demo)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
