"""JSON over TLS: `TcpTransport` on a connection that is encrypted and of which the other end is known."""

import socket
import ssl
import time
from collections.abc import Callable

from ik_client.access import Access
from ik_client.address import Address
from ik_client.tls import client_context, fault_of
from ik_client.transport_tcp import TcpTransport


class TlsTransport(TcpTransport):
    """A service behind `tls://HOST:PORT`."""

    _doubt = "if it demands certificates, pass one of its authority as cert, with its key"
    _serve = "ik-service serve --tls-cert FILE --tls-key FILE"

    def __init__(self, address: Address, clock: Callable[[], float] = time.monotonic, *, access: Access) -> None:
        """Read the certificates; connect with the first request.

        Args:
            address: Where the service is.
            clock: Monotonic time [s].
            access: Whom to trust, and what to show.

        Raises:
            ValueError: A certificate cannot be read.
        """
        super().__init__(address, clock, access)
        self._context = client_context(access)

    def _connect(self, deadline: float) -> socket.socket:
        connection = super()._connect(deadline)
        try:
            connection.settimeout(self._remaining(deadline))
            return self._context.wrap_socket(connection, server_hostname=self._address.host)
        except ssl.SSLEOFError:
            connection.close()
            raise ConnectionResetError from None
        except ssl.SSLError as error:
            connection.close()
            raise self._failed(fault_of(error, self._address.host)) from None
        except OSError:
            connection.close()
            raise

    def _ask(self, connection: socket.socket, body: bytes, deadline: float) -> bytes:
        try:
            return super()._ask(connection, body, deadline)
        except (ssl.SSLEOFError, ssl.SSLZeroReturnError):
            raise ConnectionResetError from None
        except ssl.SSLError as error:  # what a service thinks of our certificate comes with its first reply
            self.reset()
            raise self._failed(fault_of(error, self._address.host)) from None
