"""What goes wrong with eye images."""

from ik_client.errors import IKError


class EyesError(IKError):
    """There are no pictures from there, or they cannot be sent there.

    Attributes:
        url: The place.
        reason: Why, in words.
    """

    def __init__(self, url: str, reason: str) -> None:
        """Put the place in front of the reason."""
        super().__init__(f"{url}: {reason}")
        self.url = url
        self.reason = reason
