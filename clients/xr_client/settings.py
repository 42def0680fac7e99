"""What `ik-xr` is asked to do."""

import math
from dataclasses import dataclass
from pathlib import Path

from ik_client.eyes.source import check_url
from ik_client.start import SettingsError

REFERENCES = ("standing", "openwbt")


@dataclass(frozen=True, slots=True)
class Settings:
    """What to run.

    Attributes:
        service: Address of the IK service.
        robot: Address of the robot's end.
        ca: PEM file with the authority of a `tls://` service or robot; None trusts the system's.
        host: Numeric address to serve the page at over TLS.
        port: Its TCP port; 0 lets the system choose.
        local_port: TCP port of the loopback address for plain HTTP; 0 lets the system choose.
        local_only: Serve the page at the loopback address only: no TLS, no certificates.
        names: Further names and addresses by which headsets reach this machine.
        certificates: Folder of the private CA.
        reference: "standing" for hands relative to where they gripped, "openwbt" for the seeds' absolute targets.
        scale: Way of the wrist over way of the hand; None takes it from the arm's length, or 1.
        arm_length: From the operator's shoulder to the wrist [m]; None where it was not measured.
        neck: Recording in which the operator looks around; None lets the frame stand where it was at the grip.
        video: Where the robot's eye images come from: "auto" takes what the robot names, "off" shows none; or a URL.
        emulate: Serve the page with an emulated headset too.
        record: File to write the session to.
        replay: Recorded session to play instead of serving a page.
        report: JSON file to write what the run did and how long its stages took to.
        release: At the end, have the robot take its arms back; else it holds them.
    """

    service: str = "tcp://127.0.0.1:12345"
    robot: str = "tcp://127.0.0.1:12346"
    ca: Path | None = None
    host: str = "0.0.0.0"
    port: int = 8443
    local_port: int = 8080
    local_only: bool = False
    names: tuple[str, ...] = ()
    certificates: Path = Path("~/.config/ik-xr")
    reference: str = "standing"
    scale: float | None = None
    arm_length: float | None = None
    neck: Path | None = None
    video: str = "auto"
    emulate: bool = False
    record: Path | None = None
    replay: Path | None = None
    report: Path | None = None
    release: bool = False

    def __post_init__(self) -> None:
        """Check what contradicts itself.

        Raises:
            SettingsError: One line that says what.
        """
        if self.reference not in REFERENCES:
            raise SettingsError(f"there is no reference {self.reference!r}: choose one of {', '.join(REFERENCES)}")
        if self.scale is not None and self.arm_length is not None:
            raise SettingsError("--scale and --arm-length say the same thing: give one")
        if self.scale is not None and not (math.isfinite(self.scale) and self.scale > 0.0):
            raise SettingsError(f"--scale {self.scale:g}: must be a positive number")
        fitted = self.neck or self.scale or self.arm_length
        if self.reference == "openwbt" and fitted:
            raise SettingsError("--neck, --scale and --arm-length are not for --reference openwbt, which is absolute")
        if self.record is not None and self.replay is not None:
            raise SettingsError("--record and --replay do not go together: a replay is recorded already")
        if self.emulate and self.replay is not None:
            raise SettingsError("--emulate and --replay do not go together: a replay needs no headset")
        if self.video not in ("auto", "off"):
            try:
                check_url(self.video)
            except ValueError:
                raise SettingsError(f"--video {self.video}: give auto, off, shm:NAME or zenoh://HOST:PORT") from None
        for flag, port in (("--port", self.port), ("--local-port", self.local_port)):
            if not 0 <= port < 65536:
                raise SettingsError(f"{flag} {port}: must be from 0 to 65535")
