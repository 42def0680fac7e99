"""`ik-sim --listen`: the robot alone, without a service and without a loop; commands come over the link.

It stands for the process that runs beside the motors of a real robot. Whatever happens to the programs that command it,
its arms hold; when it is asked to end itself, by SIGTERM or Ctrl-C, it gives them back first.
"""

import contextlib
import json
import signal
import ssl
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console

from ik_client.access import Access, read_token
from ik_client.eyes.block_file import PREFIX
from ik_client.eyes.source import check_url
from ik_client.robot_end import LinkServer
from ik_client.robot_end.guard import RAMP
from ik_proto.host_port import HostPort
from ik_proto.robot_link import Welcome
from ik_proto.robots import load_description
from sim_client.eye_supervisor import EyeSupervisor
from sim_client.motion_window import MotionWindow
from sim_client.render import has_eyes
from sim_client.robot import CONTROL_PERIOD, SimRobot
from sim_client.robot_runner import RobotRunner
from sim_client.settings import SettingsError
from sim_client.window import display_fault


@dataclass(frozen=True)
class RobotSettings:
    """What to run.

    Attributes:
        listen: HOST:PORT; port 0 lets the system choose.
        robot: Name or path of the robot's description.
        headless: Open no window.
        duration: Simulated time to run [s]; None until it is asked to end.
        report: JSON file for the report.
        token_file: File with the token a loop must show; None takes the environment variable `IK_TOKEN`, if it is set.
        tls_cert: PEM file with the robot's certificate, for TLS.
        tls_key: PEM file with its private key.
        tls_client_ca: PEM file with the authorities that a loop's certificate must come from.
        insecure: Let other machines in without asking who they are.
        eyes_to: Where to show what the robot's eyes see: "shm" for shared memory, named after the port; a URL of
            `ik_client.eyes`; or "off".
    """

    listen: str
    robot: str = "g1"
    headless: bool = False
    duration: float | None = None
    report: Path | None = None
    token_file: Path | None = None
    tls_cert: Path | None = None
    tls_key: Path | None = None
    tls_client_ca: Path | None = None
    insecure: bool = False
    eyes_to: str = "shm"

    def __post_init__(self) -> None:
        """Check what contradicts itself.

        Raises:
            SettingsError: One line that says what.
        """
        if self.duration is not None and not 0.0 < self.duration < float("inf"):
            raise SettingsError(f"--duration {self.duration:g}: must be a positive number")
        if (self.tls_cert is None) != (self.tls_key is None):
            raise SettingsError("--tls-cert and --tls-key belong together: give both")
        if self.tls_client_ca is not None and self.tls_cert is None:
            raise SettingsError("--tls-client-ca needs TLS: give --tls-cert and --tls-key too")
        if self.eyes_to not in ("shm", "off"):
            try:
                check_url(self.eyes_to)
            except ValueError:
                raise SettingsError(f"--eyes-to {self.eyes_to}: give shm, zenoh://HOST:PORT or off") from None


def run_robot(settings: RobotSettings, console: Console, messages: Console) -> None:
    """Run the robot until it is asked to end, then give its arms back.

    Args:
        settings: What to run.
        console: Where to say that it is ready: in words if it is a terminal, else as one line of JSON.
        messages: Where to say everything else.

    Raises:
        SettingsError: The options cannot be used.
        RobotError: The robot's description or model cannot be used.
        OSError: Nothing can listen there.
    """

    def say(line: str) -> None:
        messages.print(line, markup=False, highlight=False, soft_wrap=True)

    address = HostPort.parse(settings.listen)
    token = read_token(settings.token_file) if settings.token_file else Access.of(None, None, None, None, None).token
    if not (address.loopback or token or settings.tls_client_ca or settings.insecure):
        raise SettingsError(
            f"--listen {address} lets other machines in, and nothing would ask who they are: give --token-file FILE, "
            "--tls-client-ca FILE, or --insecure to do without; a loopback address like 127.0.0.1 needs none"
        )
    description = load_description(settings.robot)
    robot = SimRobot(description)
    welcome = Welcome(description.name, description.arm_joints, CONTROL_PERIOD)
    link = LinkServer(welcome, token=token, ssl=_tls(settings))
    stop = _StopSignals()
    try:
        port = link.start(address.host, address.port)
    except OSError as error:
        raise OSError(f"cannot listen on {address}: {error.strerror or error}") from None
    with contextlib.ExitStack() as stack:
        stack.callback(link.close)
        eyes = _eyes(settings, robot, link, port, say, stack)
        bound = HostPort(address.host, port)
        if console.is_terminal:
            say(f"{description.name} takes commands on {bound}; Ctrl-C gives the arms back and ends it")
        else:
            ready = {"robot": description.name, "listen": str(bound), "eyes": link.welcome.eyes}
            console.out(json.dumps(ready), highlight=False)

        def moved(now: float) -> None:
            if eyes is not None:
                eyes.show(now, robot.data.qpos)

        runner = RobotRunner(robot, link, say, moved=moved)
        window = _window(settings, robot, say)
        if window is None:
            runner.run(lambda: not stop.asked, settings.duration)
        else:
            stack.callback(window.close)
            runner.run(lambda: not stop.asked and window.is_open(), settings.duration, window.show)
        if not robot.released:
            say("giving the arms back")
        released = runner.release(RAMP)
        say("the weight is 0: the arms are given back" if released else f"the weight is still {robot.guard.weight:.2f}")
    if settings.report:
        runner.record.report(robot, link.tally).write(settings.report)
        say(f"wrote {settings.report}")


def _eyes(
    settings: RobotSettings,
    robot: SimRobot,
    link: LinkServer,
    port: int,
    say: Callable[[str], None],
    stack: contextlib.ExitStack,
) -> EyeSupervisor | None:
    """Have a process of its own show what the robot's eyes see, and tell loops where; None where nothing is shown."""
    if settings.eyes_to == "off":
        return None
    if not has_eyes(robot.model):
        say(f"no pictures: {robot.description.name} has no cameras left_eye and right_eye")
        return None
    url = f"shm:{PREFIX}{port}" if settings.eyes_to == "shm" else settings.eyes_to
    link.welcome = replace(link.welcome, eyes=url)

    def gone() -> None:
        link.welcome = replace(link.welcome, eyes="")

    eyes = EyeSupervisor(url, settings.robot, robot.model.nq, say, gone)
    stack.callback(eyes.close)
    return eyes


class _StopSignals:
    """Notes that the process is asked to end; the control tick that runs is finished first."""

    def __init__(self) -> None:
        self.asked = False
        signal.signal(signal.SIGTERM, self._ask)
        signal.signal(signal.SIGINT, self._ask)

    def _ask(self, _signal: int, _frame: object) -> None:
        self.asked = True


def _tls(settings: RobotSettings) -> ssl.SSLContext | None:
    if settings.tls_cert is None or settings.tls_key is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_cert_chain(settings.tls_cert, settings.tls_key, password="")
        if settings.tls_client_ca is not None:
            context.load_verify_locations(settings.tls_client_ca)
            context.verify_mode = ssl.CERT_REQUIRED
    except (OSError, ValueError) as error:  # SSLError is an OSError
        reason = getattr(error, "reason", None) or getattr(error, "strerror", None) or str(error)
        raise SettingsError(f"--tls-cert, --tls-key, --tls-client-ca: cannot be used ({reason})") from None
    return context


def _window(settings: RobotSettings, robot: SimRobot, say: Callable[[str], None]) -> MotionWindow | None:
    """Open the window; None without one."""
    fault = "" if settings.headless else display_fault()
    if settings.headless or fault:
        if fault:
            say(f"{fault}; running headless")
        return None
    return MotionWindow(robot)
