"""The written contract (vectors, schema, README) and the code agree, also in the eyes of libraries we did not write."""

import json
import re
import runpy
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import umsgpack

import ik_proto
from ik_proto import JSON, MSGPACK, STATUS_TABLE, FrameDecoder, limits, parse_request, parse_solve_reply

PROTO = Path(__file__).resolve().parents[2] / "proto"
VECTORS = PROTO / "vectors"
GOLDEN = runpy.run_path(str(VECTORS / "make.py"))
SCHEMA = json.loads((PROTO / "schema" / "messages.schema.json").read_text())


def validator(message: str) -> Any:
    return jsonschema.Draft202012Validator({**SCHEMA, "anyOf": [{"$ref": f"#/$defs/{message}"}]})


@pytest.mark.parametrize("name", GOLDEN["files"]().keys())
def test_golden_files_are_what_the_code_writes(name: str) -> None:
    assert (VECTORS / name).read_bytes() == GOLDEN["files"]()[name]


def test_no_golden_file_is_forgotten() -> None:
    assert {file.name for file in VECTORS.iterdir() if file.is_file()} == {*GOLDEN["files"](), "make.py"}


def as_numbers(document: dict[str, Any]) -> dict[str, Any]:
    """Arrays, lists and raw little-endian float64 alike as flat lists of numbers."""

    def plain(value: Any) -> Any:
        if isinstance(value, bytes):
            return np.frombuffer(value, "<f8").tolist()
        if isinstance(value, list | np.ndarray) and not (len(value) and isinstance(value[0], str)):
            return np.ravel(value).tolist()
        return value

    return {key: plain(value) for key, value in document.items()}


@pytest.mark.parametrize("name", GOLDEN["EXAMPLES"].keys())
def test_foreign_libraries_read_the_vectors(name: str) -> None:
    want = as_numbers(GOLDEN["EXAMPLES"][name])
    assert as_numbers(json.loads((VECTORS / f"{name}.json").read_bytes())) == want
    if name != "openwbt_request":
        assert as_numbers(umsgpack.unpackb((VECTORS / f"{name}.msgpack").read_bytes())) == want


def test_bytes_of_foreign_libraries_are_read() -> None:
    document = json.loads((VECTORS / "solve_request.json").read_bytes())
    from_lists = parse_request(MSGPACK.decode(umsgpack.packb(document)), 14)
    from_json = parse_request(JSON.decode(json.dumps(document).encode()), 14)
    raw = {k: np.array(v, "<f8").tobytes() if isinstance(v, list) else v for k, v in document.items()}
    from_raw = parse_request(MSGPACK.decode(umsgpack.packb(raw)), 14)
    for other in (from_lists, from_json):
        for field in ("left_wrist", "right_wrist", "q", "dq"):
            assert np.array_equal(getattr(from_raw, field), getattr(other, field))


def test_the_frame_vector_is_one_frame() -> None:
    body = (VECTORS / "solve_request.json").read_bytes()
    assert FrameDecoder().feed((VECTORS / "solve_request.frame").read_bytes()) == [body]


@pytest.mark.parametrize("name", GOLDEN["EXAMPLES"].keys())
def test_vectors_fit_their_schema_and_no_other_kind(name: str) -> None:
    document = json.loads((VECTORS / f"{name}.json").read_bytes())
    validator(name).validate(document)
    kind = "request" if name.endswith("request") else "reply"
    others = [n for n in GOLDEN["EXAMPLES"] if n != name and n.endswith("request") == (kind == "request")]
    assert not any(validator(other).is_valid(document) for other in others)


@pytest.mark.parametrize(
    "change",
    [{"q": [0.0, None]}, {"left_wrist": np.eye(3).tolist()}, {"id": -1}, {"v": 2}, {"presett": 1}, {"q": "0"}],
    ids=str,
)
def test_schema_and_code_refuse_alike(change: dict[str, Any]) -> None:
    document = json.loads((VECTORS / "solve_request.json").read_bytes()) | change
    assert not validator("solve_request").is_valid(document)
    with pytest.raises(ik_proto.RequestError):
        parse_request(document, 14)


def test_a_reply_without_a_required_key_fits_neither_schema_nor_code() -> None:
    document = json.loads((VECTORS / "solve_reply.json").read_bytes())
    for key in SCHEMA["$defs"]["solve_reply"]["required"]:
        if key == "id":  # 0 where absent
            continue
        less = {k: v for k, v in document.items() if k != key}
        assert not validator("solve_reply").is_valid(less), key
        with pytest.raises(ik_proto.ReplyError):
            parse_solve_reply(less, 14)


def test_schema_lists_every_status() -> None:
    assert SCHEMA["$defs"]["status"]["enum"] == [status.value for status in STATUS_TABLE]


def test_readme_holds_the_status_table() -> None:
    rows = re.findall(r"^\| `(\w+)` \| (yes|no) \| (.+?) \| (.+?) \|$", (PROTO / "README.md").read_text(), re.MULTILINE)
    table = [(s.value, "yes" if i.success else "no", i.meaning, i.action) for s, i in STATUS_TABLE.items()]
    assert rows == table


def test_readme_quotes_the_limits() -> None:
    text = (PROTO / "README.md").read_text()
    for number in (limits.MAX_FRAME_BYTES, limits.MAX_ABS_POSITION, limits.MAX_ABS_JOINT):
        assert f"{number:g}" in text or f"{number:,}" in text, number


def test_everything_exported_exists() -> None:
    assert [name for name in ik_proto.__all__ if not hasattr(ik_proto, name)] == []
