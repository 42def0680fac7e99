"""What a client shows to be let in, and how it makes sure of whom it talks to."""

import os
import stat
from dataclasses import dataclass, field
from pathlib import Path

ENVIRONMENT = "IK_TOKEN"
"""Variable that holds the token where none is given."""

_LONGEST_TOKEN = 256

File = str | os.PathLike[str]


@dataclass(frozen=True, slots=True)
class Access:
    """The credentials of one client.

    Attributes:
        token: The service's secret; empty for none.
        ca: PEM file with the authority that the service's certificate must come from; empty for the system's.
        cert: PEM file with this client's certificate; empty for none.
        key: PEM file with its private key; empty where `cert` holds it too.
        zenoh_config: Zenoh configuration (JSON5) that is passed through; empty for none.
    """

    token: str = field(default="", repr=False)
    ca: str = ""
    cert: str = ""
    key: str = ""
    zenoh_config: str = ""

    @classmethod
    def of(
        cls, token: str | None, ca: File | None, cert: File | None, key: File | None, zenoh_config: File | None
    ) -> "Access":
        """Take what a caller gave; a token that is None comes from the environment.

        Raises:
            ValueError: It makes no sense; one line, without the token.
        """
        token = (os.environ.get(ENVIRONMENT, "") if token is None else token).strip()
        if len(token) > _LONGEST_TOKEN or not (token.isascii() and (token.isprintable())):
            raise ValueError(f"a token is a line of at most {_LONGEST_TOKEN} ASCII characters, this one is not")
        if key is not None and cert is None:
            raise ValueError("key is the private key of cert: give both")
        files = (os.fspath(file) if file is not None else "" for file in (ca, cert, key, zenoh_config))
        return cls(token, *files)


NO_ACCESS = Access()
"""Shows nothing."""


def read_token(file: File) -> str:
    """Read a token from its file.

    Args:
        file: A file that only its owner can read.

    Returns:
        The token.

    Raises:
        ValueError: The file cannot be read, or others can read it too.
    """
    try:
        with Path(file).open(encoding="ascii") as source:
            if stat.S_IMODE(os.fstat(source.fileno()).st_mode) & 0o077:
                raise ValueError(f"others can read the token file {file}: chmod 600 it")
            token = source.read(_LONGEST_TOKEN + 100).strip()
    except OSError as error:
        raise ValueError(f"token file {file} cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise ValueError(f"token file {file} holds something else than a token") from None
    if not token:
        raise ValueError(f"token file {file} is empty")
    return token
