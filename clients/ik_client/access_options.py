"""The options by which every command of a client is let in: a token file, certificates, Zenoh's own configuration."""

import argparse
from dataclasses import dataclass, fields
from typing import Any

from ik_client.access import ENVIRONMENT, read_token


@dataclass(frozen=True, slots=True)
class AccessFiles:
    """Where the credentials are; never what they are, so that a report may hold it.

    Attributes:
        token_file: File with the service's token; empty for the environment's, if there is one.
        ca: As in `IKClient`; empty for none, and so the others.
        cert: As in `IKClient`.
        key: As in `IKClient`.
        zenoh_config: As in `IKClient`.
    """

    token_file: str = ""
    ca: str = ""
    cert: str = ""
    key: str = ""
    zenoh_config: str = ""

    @classmethod
    def taken_from(cls, options: dict[str, Any]) -> "AccessFiles":
        """Take what `add_access_options` has read out of a command's options; what is not there stays empty."""
        return cls(**{field.name: str(options.pop(field.name)) for field in fields(cls) if field.name in options})

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments of `IKClient`.

        Raises:
            ValueError: The token file cannot be read, or others can read it too.
        """
        return {
            "token": read_token(self.token_file) if self.token_file else None,
            "ca": self.ca or None,
            "cert": self.cert or None,
            "key": self.key or None,
            "zenoh_config": self.zenoh_config or None,
        }


def add_access_options(parser: argparse.ArgumentParser) -> None:
    """Add the options to a command.

    Args:
        parser: The command's.
    """
    group = parser.add_argument_group("to be let in by a service that asks")
    group.add_argument(
        "--token-file", default="", metavar="FILE", help=f"file with the service's token [${ENVIRONMENT}]"
    )
    group.add_argument("--ca", default="", metavar="FILE", help="PEM authority of a tls:// service [the system's]")
    group.add_argument("--cert", default="", metavar="FILE", help="PEM certificate of this client, for tls:// [none]")
    group.add_argument("--key", default="", metavar="FILE", help="its PEM private key [none]")
    group.add_argument(
        "--zenoh-config", default="", metavar="FILE", help="Zenoh configuration in JSON5, for zenoh:// [none]"
    )
