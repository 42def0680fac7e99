"""The command `ik-service`: serve, info, healthcheck, token.

Heavy packages are imported only by the command that needs them.
"""

import argparse
import http.client
import sys
import time
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from ik_proto.host_port import AddressError, HostPort
from ik_proto.robots import RobotError
from ik_service.addresses import AddressInUse
from ik_service.config import CHOICES, DEFAULT_HTTP, DEFAULT_PRESET, Config, ConfigError, load_config

EXIT_OK, EXIT_FAILED, EXIT_USAGE, EXIT_ADDRESS_IN_USE = 0, 1, 2, 3

_EXIT_CODES = """\
exit codes:
  0  stopped cleanly by SIGTERM or Ctrl-C
  1  an unexpected fault; its traceback is printed
  2  a wrong option, configuration or robot; one line says which
  3  an address is in use by another process, or the robot is served already by another service
"""

_SERVE_EPILOG = f"""\
examples:
  ik-service serve                                the G1, on loopback, TCP and Zenoh
  ik-service serve --preset openwbt               the cost of OpenWBT's own server
  ik-service serve --zenoh off --smooth openwbt   for OpenWBT clients that expect filtered answers
  ik-service serve --robot my_robot.toml          another robot: a TOML beside its URDF or MJCF
  ik-service serve --config service.toml --log-format json
  ik-service token ik.token                       write a fresh secret to a file, then serve other machines with it:
  ik-service serve --tcp 0.0.0.0:12345 --token-file ik.token --tls-cert service.pem --tls-key service.key

The configuration file is TOML with the names of the options: tcp = "127.0.0.1:12345", openwbt-lag = true.
Options win over the file.

{_EXIT_CODES}"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        arguments: Command line without the program's name; None takes the process's own.

    Returns:
        The exit code, as `--help` documents.
    """
    started = time.perf_counter()
    options = vars(_parser().parse_args(arguments))
    command = options.pop("command")
    try:
        if command == "serve":
            return _serve(options, started)
        if command == "info":
            return _info(options)
        if command == "token":
            return _token(options["file"])
        return _healthcheck(HostPort.parse(options["http"]))
    except AddressInUse as error:
        return _fail(str(error), EXIT_ADDRESS_IN_USE)
    except (ConfigError, AddressError, RobotError) as error:
        return _fail(str(error), EXIT_USAGE)
    except ModuleNotFoundError as error:
        if error.name is not None and error.name.partition(".")[0] in ("ik_service", "ik_proto"):
            raise
        return _fail(f"package {error.name} is missing: pip install 'ik-service[service]'", EXIT_USAGE)
    except KeyboardInterrupt:
        return EXIT_OK


def _serve(options: dict, started: float) -> int:
    config = load_config(options.pop("config", None), options)
    from ik_service.daemon import serve

    try:
        serve(config, started)
    except AddressInUse:
        raise
    except OSError as error:
        return _fail(f"cannot listen: {error.strerror or error}", EXIT_USAGE)
    except RuntimeError as error:
        from ik_service.zenoh_server import DuplicateService  # Zenoh is not imported where it is off

        if not isinstance(error, DuplicateService):
            raise
        return _fail(str(error), EXIT_ADDRESS_IN_USE)
    return EXIT_OK


def _info(options: dict) -> int:
    config = load_config(options.pop("config", None), options)
    from ik_service.engine import Engine

    engine = Engine.build(config, "", version("ik-service"))
    about = engine.about
    rows = [
        ("robot", about.robot),
        ("model hash", about.model_hash),
        ("protocol", str(about.protocol)),
        ("version", about.version),
        ("presets", ", ".join(about.presets) + f" (default {about.default_preset})"),
        ("collision", f"{engine.collision}, margin {1e3 * about.margin:g} mm, {len(about.capsules)} capsules"),
        ("waist", ", ".join(about.waist_joints) or "none"),
        ("kernel", about.kernel + (f" ({engine.kernel_note})" if engine.kernel_note else "")),
        ("tcp", config.tcp),
        ("zenoh", config.zenoh),
        ("http", config.http),
        ("reach", f"{about.reach[0]:.3f} m left, {about.reach[1]:.3f} m right"),
    ]
    for name, value in rows:
        print(f"{name:<12}{value}")
    print(f"\n{'':>2}  {'joint, in the order of q':<32}{'lower':>9}{'upper':>9} rad{'velocity':>10} rad/s")
    for index, name in enumerate(about.joint_names):
        limits = f"{about.lower[index]:>9.4f}{about.upper[index]:>9.4f}    {about.velocity[index]:>10.1f}"
        print(f"{index:>2}  {name:<32}{limits}")
    return EXIT_OK


def _token(file: Path) -> int:
    from ik_service.token_file import write_token

    write_token(file)
    print(f"{file} holds a fresh token that only you can read; serve with --token-file {file}")
    return EXIT_OK


def _healthcheck(address: HostPort) -> int:
    connection = http.client.HTTPConnection(address.host, address.port, timeout=2.0)
    try:
        connection.request("GET", "/readyz")
        answer = connection.getresponse()
        text = answer.read(1000).decode(errors="replace").strip()
    except (OSError, http.client.HTTPException) as error:
        return _fail(f"no service answers at {address} ({error})", EXIT_FAILED)
    finally:
        connection.close()
    print(text)
    return EXIT_OK if answer.status == 200 else EXIT_FAILED


def _fail(message: str, code: int) -> int:
    print(f"ik-service: {message}", file=sys.stderr)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="ik-service", description="Inverse kinematics for a humanoid's arms, as a service."
    )
    parser.add_argument("--version", action="version", version=f"ik-service {version('ik-service')}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add_serve(commands)
    info = commands.add_parser("info", help="print what `serve` would serve", argument_default=argparse.SUPPRESS)
    _add_solver_options(info)
    token = commands.add_parser("token", help="write a fresh secret, for --token-file, to a new file")
    token.add_argument("file", metavar="FILE", type=Path, help="where; a file that exists is not overwritten")
    health = commands.add_parser("healthcheck", help="exit 0 if a service is ready, 1 if not (for containers)")
    health.add_argument("--http", metavar="HOST:PORT", default=DEFAULT_HTTP, help="its HTTP address (%(default)s)")
    return parser


def _add_serve(commands: argparse._SubParsersAction) -> None:
    serve = commands.add_parser(
        "serve",
        help="run the service",
        description="Serve inverse kinematics over TCP JSON and Zenoh until SIGTERM or Ctrl-C.",
        epilog=_SERVE_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        argument_default=argparse.SUPPRESS,
    )
    defaults = Config()
    _add_solver_options(serve)
    addresses = serve.add_argument_group("where to listen ('off' for not at all, port 0 for any free port)")
    addresses.add_argument("--tcp", metavar="HOST:PORT", help=f"JSON over TCP ({defaults.tcp})")
    addresses.add_argument("--zenoh", metavar="LOCATOR", help=f"MessagePack over Zenoh ({defaults.zenoh})")
    addresses.add_argument("--http", metavar="HOST:PORT", help=f"health and metrics ({defaults.http})")
    addresses.add_argument("--zenoh-connect", metavar="LOCATOR", help="join this Zenoh router as well (none)")
    addresses.add_argument(
        "--zenoh-config", metavar="FILE", help="Zenoh configuration in JSON5, passed through: TLS, users, access (none)"
    )
    addresses.add_argument(
        "--replica", action="store_true", help="serve beside another service of this robot on the same Zenoh network"
    )
    access = serve.add_argument_group("who may ask; without any of these, only this machine")
    access.add_argument(
        "--token-file", metavar="FILE", help="clients must show the token in this file, or in $IK_TOKEN (none)"
    )
    access.add_argument("--tls-cert", metavar="FILE", help="PEM certificate: the TCP endpoint speaks TLS (none)")
    access.add_argument("--tls-key", metavar="FILE", help="its PEM private key (none)")
    access.add_argument(
        "--tls-client-ca", metavar="FILE", help="serve clients with a certificate of this PEM authority only (none)"
    )
    access.add_argument(
        "--insecure", action="store_true", help="accept addresses that other machines can reach, and ask nobody"
    )
    openwbt = serve.add_argument_group("for OpenWBT clients, on the TCP endpoint")
    openwbt.add_argument(
        "--smooth",
        choices=CHOICES["smooth"],
        help=f"'openwbt' filters answers as their server does ({defaults.smooth})",
    )
    openwbt.add_argument(
        "--openwbt-lag", action="store_true", help="answer with the previous request's result, as their server does"
    )
    logs = serve.add_argument_group("logs, on standard error")
    logs.add_argument(
        "--log-format",
        choices=CHOICES["log_format"],
        help=f"json also puts a ready line on standard output ({defaults.log_format}: by whether this is a terminal)",
    )
    logs.add_argument(
        "--log-level", choices=CHOICES["log_level"], help=f"least severe level written ({defaults.log_level})"
    )


def _add_solver_options(command: argparse.ArgumentParser) -> None:
    defaults = Config()
    command.add_argument(
        "--robot",
        metavar="NAME|PATH",
        help=f"packaged robot, or a description beside a URDF or MJCF ({defaults.robot})",
    )
    command.add_argument("--preset", metavar="NAME", help=f"cost used when a request names none ({DEFAULT_PRESET})")
    command.add_argument(
        "--collision",
        choices=CHOICES["collision"],
        help=f"what is done about self-collision when a request does not say ({defaults.collision})",
    )
    command.add_argument(
        "--kernel",
        choices=CHOICES["kernel"],
        help=f"compiled C, interpreted, or compiled where a compiler is found ({defaults.kernel})",
    )
    command.add_argument("--config", metavar="FILE", type=Path, help="TOML file with these settings (none)")
