"""The secret of a service: a line of text in a file that only its owner can read, or in the environment.

Never an option's value: the process list shows those to everybody on the machine.
"""

import os
import secrets
import stat
from collections.abc import Mapping
from pathlib import Path

from ik_service.config import ConfigError

ENVIRONMENT = "IK_TOKEN"
"""Variable that holds a token where no file is named."""

_SHORTEST, _LONGEST = 16, 256


def read_token(file: str, environment: Mapping[str, str]) -> bytes | None:
    """Find the token to demand.

    Args:
        file: Path of the token file; empty for none. It wins over the environment.
        environment: The process's environment.

    Returns:
        The token, or None where there is none.

    Raises:
        ConfigError: The file cannot be read, or others can read it too; or what is there makes no token.
    """
    if file:
        return _checked(_read_private(Path(file)), file)
    if ENVIRONMENT in environment:
        return _checked(environment[ENVIRONMENT], ENVIRONMENT)
    return None


def write_token(file: Path) -> None:
    """Write a fresh token to a new file that only its owner can read.

    Args:
        file: Where; never one that exists.

    Raises:
        ConfigError: It exists, or cannot be written.
    """
    try:
        with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="ascii") as out:
            out.write(secrets.token_urlsafe(32) + "\n")
    except FileExistsError:
        raise ConfigError(f"{file} exists, and a token is not overwritten: remove it, or choose another name") from None
    except OSError as error:
        raise ConfigError(f"{file} cannot be written ({error.strerror})") from None


def _read_private(file: Path) -> str:
    try:
        with file.open(encoding="utf-8") as source:
            status = os.fstat(source.fileno())
            if status.st_uid not in (os.getuid(), 0):
                raise ConfigError(f"token file {file} belongs to another user: make one of your own")
            if stat.S_IMODE(status.st_mode) & 0o077:
                raise ConfigError(f"others can read the token file {file}: chmod 600 it")
            return source.read(_LONGEST + 100)
    except OSError as error:
        raise ConfigError(f"token file {file} cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise ConfigError(f"token file {file} holds something else than a token") from None


def _checked(text: str, origin: str) -> bytes:
    token = text.strip()
    if not (_SHORTEST <= len(token) <= _LONGEST and token.isascii() and token.isprintable() and " " not in token):
        raise ConfigError(
            f"{origin} must hold {_SHORTEST} to {_LONGEST} printable ASCII characters without a space: "
            "make a good one with: ik-service token FILE"
        )
    return token.encode()
