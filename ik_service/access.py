"""Who may ask: the doorkeeper in front of a connection or a queryable.

- Where the service has a token, whoever asks shows it in the request's field `token`. On a TCP connection once is
  enough: it is trusted until it closes. On Zenoh, where a query is all there is, every query shows it.
- Where it has none, everybody is admitted.
- The token is taken out of the request, so nothing behind the door sees it, logs it or repeats it.
- Tokens are compared in constant time.
"""

import hmac

from ik_proto import Document


class Doorkeeper:
    """Decides which requests are looked at; one for each TCP connection, and one for each Zenoh queryable."""

    def __init__(self, token: bytes | None, remembers: bool) -> None:
        """Take the secret.

        Args:
            token: What must be shown; None admits everybody.
            remembers: Whether one request that shows it speaks for all that follow.
        """
        self._token = token
        self._remembers = remembers
        self._trusted = False

    @property
    def reads_unseen(self) -> bool:
        """Whether a large body may be read before it has shown its token.

        Not that of a connection that has not been trusted yet: it can show its token in a small request first. Where
        nothing is remembered there is no first, so a large body is read, and then admitted or not.
        """
        return self._token is None or self._trusted or not self._remembers

    def admits(self, document: Document) -> bool:
        """Take the token out of a request, and say whether to answer it.

        Args:
            document: The request; loses its field `token`.

        Returns:
            False where a token is demanded and this one is missing or wrong.
        """
        shown = document.pop("token", None)
        if self._token is None or self._trusted:
            return True
        # What a codec decodes may hold lone surrogates, which have no bytes in UTF-8.
        if not isinstance(shown, str) or not hmac.compare_digest(shown.encode(errors="backslashreplace"), self._token):
            return False
        self._trusted = self._remembers
        return True
