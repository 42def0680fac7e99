"""Certificates for tests, made when they are needed."""

from datetime import UTC, datetime
from pathlib import Path

import trustme

HOSTS = ("localhost", "127.0.0.1")


def make_certificates(folder: Path) -> Path:
    """Write authorities, and certificates with their keys, as PEM files.

    `ca` has issued `service` and `client`, `elsewhere` (for another host) and `expired`; `stranger_ca` has issued
    `stranger`, whose names are those of `client`.
    """
    ca, stranger_ca = trustme.CA(), trustme.CA()
    ca.cert_pem.write_to_path(folder / "ca.pem")
    stranger_ca.cert_pem.write_to_path(folder / "stranger_ca.pem")
    begin, end = datetime(2020, 1, 1, tzinfo=UTC), datetime(2021, 1, 1, tzinfo=UTC)
    for name, issued in {
        "service": ca.issue_cert(*HOSTS),
        "client": ca.issue_cert("operator@robot.test", common_name="operator"),
        "elsewhere": ca.issue_cert("elsewhere.test"),
        "expired": ca.issue_cert(*HOSTS, not_before=begin, not_after=end),
        "stranger": stranger_ca.issue_cert("operator@robot.test", common_name="operator"),
    }.items():
        (pem,) = issued.cert_chain_pems
        pem.write_to_path(folder / f"{name}.pem")
        issued.private_key_pem.write_to_path(folder / f"{name}.key")
    return folder
