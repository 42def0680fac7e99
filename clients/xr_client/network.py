"""Names, addresses and certificates by which headsets on the network know this machine, now and as they change."""

import datetime
import ssl
from collections.abc import Callable, Sequence
from ipaddress import ip_address

from xr_client.addresses import host_names, local_addresses
from xr_client.certificates import Credentials, certificate_fault, ensure_credentials
from xr_client.door import Door
from xr_client.renewal import Renewal
from xr_client.server import XrServer
from xr_client.settings import Settings

_EVERYWHERE = ("0.0.0.0", "::")


class Network:
    """Names, addresses and certificates by which headsets on the network know this machine.

    Attributes:
        made: The certificate the server begins with.
        tls: What it serves with; gets each new certificate.
    """

    def __init__(self, settings: Settings) -> None:
        """Find out what this machine is called, and make the certificates that are missing.

        Args:
            settings: Where to serve, and the folder of the certificates.

        Raises:
            CertificateError: They cannot be used.
        """
        self._settings = settings
        self._folder = settings.certificates.expanduser()
        self.made = ensure_credentials(self._folder, self.hosts(), self._speak_for(), _now())
        self.tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self.tls.minimum_version = ssl.TLSVersion.TLSv1_2
        self._load(self.made)

    def hosts(self) -> list[str]:
        """Names and addresses at present, the most important first."""
        host = self._settings.host
        own = local_addresses(ipv6=host == "::") if host in _EVERYWHERE else [host]
        return list(dict.fromkeys([*self._settings.names, *map(str, own), *host_names()]))

    def offer(self, hosts: Sequence[str], url: Callable[[str], str]) -> tuple[list[str], list[str]]:
        """The URLs that headsets accept, and why they would refuse others.

        Args:
            hosts: Names and addresses of this machine.
            url: Gives the page's URL at one of them.
        """
        faults = {host: certificate_fault(self.made.leaf, host, _now()) for host in hosts}
        pages = [url(host) for host, fault in faults.items() if fault is None]
        refused = [fault for fault in faults.values() if fault is not None]
        if not pages:
            refused.append("this machine has no address in a private network: give the one to use with --name")
        return pages, refused

    def renewal(self, server: XrServer, door: Door, url: Callable[[str], str], say: Callable[[str], None]) -> Renewal:
        """What looks after the certificate of a server that runs.

        Args:
            server: The server, with `tls`.
            door: Learns names and addresses as they change.
            url: Gives the page's URL at one of them.
            say: Tells a person of a new address, in a line.
        """
        known = self.hosts()

        def renewed(made: Credentials, hosts: Sequence[str]) -> None:
            # In the server's own thread, so that no handshake meets a certificate without its key.
            server.call(lambda: self._load(made))
            door.know(hosts)
            for host in hosts:
                if host not in known:
                    say(f"this machine has got another address: in the headset's browser, open {url(host)}")
            known[:] = hosts

        return Renewal(self._folder, self.made, self.hosts, self._speak_for(), renewed)

    def _speak_for(self) -> list[str]:
        """Names that a new authority shall speak for."""
        return [*host_names(), *(name for name in self._settings.names if not _is_address(name))]

    def _load(self, made: Credentials) -> None:
        self.tls.load_cert_chain(made.leaf, made.key)


def _is_address(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True


def _now() -> datetime.datetime:
    return datetime.datetime.now(datetime.UTC)
