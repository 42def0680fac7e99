"""What a client does before its first tick: whom to trust, whether service and robot belong together, a fresh state.

All of it raises errors of one line that say what to do.
"""

import ssl
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ik_client.client import IKClient
from ik_client.robot_end import RobotLink, RobotSilent
from ik_proto import InfoReply

_INFO_TIMEOUT, _STATE_TIMEOUT = 2.0, 2.0


class SettingsError(ValueError):
    """Options that cannot be used; one line that says what to do."""


def trusting(ca: Path | None) -> ssl.SSLContext | None:
    """What to trust a `tls://` robot by; None for the system's authorities.

    Raises:
        SettingsError: The file holds no certificate.
    """
    if ca is None:
        return None
    try:
        return ssl.create_default_context(cafile=ca)
    except OSError as error:  # an ssl.SSLError is one too
        raise SettingsError(f"{ca} holds no certificate of an authority ({error.strerror})") from None


def info_for(robot: RobotLink, robot_url: str, service_url: str, ca: Path | None = None, **access: Any) -> InfoReply:
    """What the service says of itself; it must serve this very robot.

    Args:
        robot: The robot.
        robot_url: Its address.
        service_url: The service's.
        ca: As in `IKClient`.
        access: What else `IKClient` takes to be let in.

    Raises:
        SettingsError: It serves another one.
        IKError: It does not answer.
    """
    with IKClient(service_url, timeout=_INFO_TIMEOUT, ca=ca, **access) as asking:
        info = asking.info()
    if tuple(info.joint_names) != robot.welcome.joint_names:
        raise SettingsError(
            f"{service_url} serves robot {info.robot!r} with other arm joints than {robot.welcome.robot!r} at "
            f"{robot_url}: start both for the same robot"
        )
    return info


def await_state(robot: RobotLink) -> None:
    """Wait for a fresh state: the first tick needs one, and starting may have taken all of a busy machine.

    Raises:
        RobotSilent: None comes.
    """
    end = time.monotonic() + _STATE_TIMEOUT
    while True:
        try:
            robot.read()
            return
        except RobotSilent:
            if time.monotonic() > end:
                raise
        time.sleep(robot.welcome.period)


def writable(path: Path | None) -> Callable[[Callable[[Path], None]], None]:
    """What has a report written to a file; whether that can be is found out before the run.

    Args:
        path: The file; None where nothing is to be written.

    Returns:
        Takes what writes to a path, such as `LoopReport.write`.

    Raises:
        SettingsError: It cannot be written.
    """
    if path is None:
        return lambda _write: None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    except OSError as error:
        raise SettingsError(f"{path} cannot be written: {error.strerror}") from None
    return lambda write: write(path)
