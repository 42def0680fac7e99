"""Sound messages to start from: the contract's vectors, and requests with every option."""

from pathlib import Path

from ik_proto import Codec

VECTORS = Path(__file__).resolve().parents[2] / "proto" / "vectors"


def requests(codec: Codec) -> list[bytes]:
    """Bodies of requests in a codec's form."""
    return _bodies(codec, ["*_request"])


def replies(codec: Codec) -> list[bytes]:
    """Bodies of replies in a codec's form."""
    return _bodies(codec, ["*_reply", "refusal"])


def _bodies(codec: Codec, patterns: list[str]) -> list[bytes]:
    files = [file for pattern in patterns for file in sorted(VECTORS.glob(f"{pattern}.{codec.name}"))]
    if not files:
        raise FileNotFoundError(f"no vectors at {VECTORS}")
    return [file.read_bytes() for file in files]
