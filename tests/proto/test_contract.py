"""The written contract (vectors, schema, README) and the code agree, also in the eyes of libraries we did not write."""

import json
import re
import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import umsgpack

import ik_proto
from ik_proto import JSON, MSGPACK, STATUS_TABLE, FrameDecoder, limits, parse_request, parse_solve_reply
from ik_proto.requests import _FIELDS

PROTO = Path(__file__).resolve().parents[2] / "proto"
VECTORS = PROTO / "vectors"
GOLDEN = runpy.run_path(str(VECTORS / "make.py"))
SCHEMA = json.loads((PROTO / "schema" / "messages.schema.json").read_text())


def read(name: str) -> dict[str, Any]:
    return json.loads((VECTORS / f"{name}.json").read_bytes())


def validator(message: str) -> Any:
    return jsonschema.Draft202012Validator({**SCHEMA, "anyOf": [{"$ref": f"#/$defs/{message}"}]})


def schema_of(name: str) -> str:
    return GOLDEN["KINDS"].get(name, name)


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
        if isinstance(value, tuple):
            return list(value)
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
    validator(schema_of(name)).validate(document)
    kinds = {schema_of(n) for n in GOLDEN["EXAMPLES"] if n.endswith("request") == name.endswith("request")}
    assert [kind for kind in kinds if validator(kind).is_valid(document)] == [schema_of(name)]


@pytest.mark.parametrize(
    "change",
    [
        {"q": [0.0, None]},
        {"left_wrist": np.eye(3).tolist()},
        {"id": -1},
        {"v": 2},
        {"presett": 1},
        {"q": "0"},
        {"mode": "walk"},
        {"mode": 1},
        {"waist": ["a", "b", "c"]},
        {"left_elbow": [0.0, 0.0, 1.0]},
        {"left_elbow": [0.0, 0.0, 1.0, 1.5]},
        {"right_elbow": [0.0, 0.0, 1.0, -0.5]},
        {"weights": [[1.0, 1.0]]},
        {"weights": [[1.0, 1.0], [1.0, 2.0]]},
        {"collision": "on"},
        {"starts": 0},
        {"starts": 257},
        {"starts": 2.5},
        {"token": 1},
        {"stream": 1},
        {"stream": "s" * 65},
        {"budget_ms": 0},
        {"budget_ms": 10_001},
        {"budget_ms": "1"},
    ],
    ids=str,
)
def test_schema_and_code_refuse_alike(change: dict[str, Any]) -> None:
    for name in ("solve_request", "reach_request"):
        document = read(name) | change
        assert not validator("solve_request").is_valid(document)
        with pytest.raises(ik_proto.RequestError):
            parse_request(document, 14)


@pytest.mark.parametrize(
    "change",
    [
        {"q": []},
        {"q": [0.0] * 14},
        {"left_wrist": np.eye(4).tolist()},
        {"left_wrist": np.ones((1025, 4, 4)).tolist()},
        {"waist": [0.0] * 3},
        {"left_elbow": [[0.0, 0.0, 1.0, 1.5]] * 2},
        {"weights": [[1.0, 1.0], [1.0, 1.0]]},
        {"collision": "on"},
        {"starts": [1, 1]},
        {"mode": ["track", "reach"]},
        {"presett": 1},
        {"stream": ["s", "t"]},
    ],
    ids=lambda change: next(iter(change)),
)
def test_schema_and_code_refuse_a_batch_alike(change: dict[str, Any]) -> None:
    document = read("solve_batch_request") | change
    assert not validator("solve_batch_request").is_valid(document)
    with pytest.raises(ik_proto.RequestError):
        parse_request(document, 14)


@pytest.mark.parametrize(
    "name", ["solve_request", "solve_batch_request", "fk_request", "clearance_request", "info_request"]
)
def test_schema_and_code_let_what_is_not_required_be_null(name: str) -> None:
    schema = SCHEMA["$defs"][name]
    optional = schema["properties"].keys() - {"verb", "v", "id", *schema["required"]}
    document = read(name) | dict.fromkeys(optional)
    validator(name).validate(document)
    parse_request(document, 14)


def test_schema_and_code_know_the_same_fields_and_words() -> None:
    fields = _FIELDS
    defs = SCHEMA["$defs"]
    for verb in ("solve", "solve_batch", "fk", "clearance", "velocity", "info"):
        assert defs[f"{verb}_request"]["properties"].keys() == fields[verb]
    assert defs["stream"]["maxLength"] == limits.MAX_STREAM_CHARACTERS
    assert defs["budget_ms"]["maximum"] == limits.MAX_BUDGET_MS
    assert defs["mode"]["enum"] == [*ik_proto.MODES, None]
    assert defs["collision"]["enum"] == [*ik_proto.COLLISIONS, None]
    assert (defs["starts"]["minimum"], defs["starts"]["maximum"]) == (1, limits.MAX_STARTS)
    for properties in (defs["solve_batch_request"]["properties"], defs["batch_reply"]["properties"]):
        lengths = [value["maxItems"] for value in properties.values() if value.get("type") == "array"]
        assert set(lengths) == {limits.MAX_BATCH}
    assert defs["clearance_request"]["properties"]["q"]["maxItems"] == limits.MAX_POSTURES
    assert defs["batch_reply"]["properties"]["status"]["enum"] == [status.value for status in ik_proto.ANSWERS]


@pytest.mark.parametrize("name", ["solve_reply", "blocked_reply"])
def test_schema_and_code_want_what_belongs_together(name: str) -> None:
    document = read("blocked_reply") | read(name)
    for key in ("nearest", "starts"):
        less = {k: v for k, v in document.items() if k != key}
        assert not validator("solve_reply").is_valid(less)
        with pytest.raises(ik_proto.ReplyError):
            parse_solve_reply(less, 14)


PARSERS: dict[str, Callable[[dict[str, Any]], Any]] = {
    "solve_reply": lambda document: parse_solve_reply(document, 14),
    "batch_reply": lambda document: ik_proto.parse_batch_reply(document, 2, 14),
    "fk_reply": ik_proto.parse_fk_reply,
    "clearance_reply": lambda document: ik_proto.parse_clearance_reply(document, 2),
    "info_reply": ik_proto.parse_info_reply,
}


@pytest.mark.parametrize("name", PARSERS)
def test_a_reply_without_a_required_key_fits_neither_schema_nor_code(name: str) -> None:
    document = read(name)
    PARSERS[name](document)
    absent_is_null = {"id", "clearance"} if name in ("batch_reply", "clearance_reply") else {"id"}
    if name in ("fk_reply", "clearance_reply", "info_reply"):
        absent_is_null.add("sol_q")
    for key in SCHEMA["$defs"][name]["required"]:
        less = {k: v for k, v in document.items() if k != key}
        assert not validator(name).is_valid(less), key
        if key not in absent_is_null:
            with pytest.raises(ik_proto.ReplyError):
                PARSERS[name](less)


def test_schema_lists_every_status() -> None:
    assert SCHEMA["$defs"]["status"]["enum"] == [status.value for status in STATUS_TABLE]


def test_readme_holds_the_status_table() -> None:
    rows = re.findall(r"^\| `(\w+)` \| (yes|no) \| (.+?) \| (.+?) \|$", (PROTO / "README.md").read_text(), re.MULTILINE)
    table = [(s.value, "yes" if i.success else "no", i.meaning, i.action) for s, i in STATUS_TABLE.items()]
    assert rows == table


def test_readme_quotes_the_limits() -> None:
    text = (PROTO / "README.md").read_text()
    for number in (
        limits.MAX_FRAME_BYTES,
        limits.MAX_ABS_POSITION,
        limits.MAX_ABS_JOINT,
        limits.MAX_BATCH,
        limits.MAX_POSTURES,
        limits.MAX_STARTS,
        limits.DEFAULT_STARTS,
        limits.MIN_ELBOW_LENGTH,
        limits.MAX_STREAM_CHARACTERS,
        limits.MAX_BUDGET_MS,
    ):
        assert re.search(rf"(?<![\d.,])({number:,}|{number:,g}|{number:g})(?!\d|,\d)", text), number


def test_readme_lists_every_field() -> None:
    text = (PROTO / "README.md").read_text()
    rows = re.findall(r"^\| (`[^|]+) \|", text, re.MULTILINE)
    listed = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    requests = ("solve_request", "solve_batch_request", "fk_request", "clearance_request")
    for kind in (*requests, "solve_reply", "fk_reply", "clearance_reply", "info_reply"):
        assert SCHEMA["$defs"][kind]["properties"].keys() <= listed, kind
    batch = text[text.index("**The answer to a batch**") :].split("\n\n")[0]
    own = SCHEMA["$defs"]["batch_reply"]["properties"].keys() - SCHEMA["$defs"]["refusal"]["properties"].keys()
    assert {name for name in own | {"sol_q", "status", "success"} if f"`{name}`" not in batch} == set()


EXAMPLES = re.findall(r"^```json\n(.*?)^```$", (PROTO / "README.md").read_text(), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("example", EXAMPLES)
def test_readme_examples_are_what_schema_and_code_take(example: str) -> None:
    fragment = json.loads(example)
    if fragment.get("verb") == "solve_batch":
        validator("solve_batch_request").validate(fragment)
        got = parse_request(fragment, 2)
        assert isinstance(got, ik_proto.SolveBatchRequest)
        assert got.q.shape == (2, 2)
    elif "status" in fragment:
        document = read("solve_reply") | fragment
        validator("solve_reply").validate(document)
        parse_solve_reply(document, 14)
        assert fragment.keys() <= SCHEMA["$defs"]["solve_reply"]["properties"].keys()
    else:
        document = read("solve_request") | fragment
        validator("solve_request").validate(document)
        parse_request(document, 14)


def test_readme_has_an_example_of_every_new_thing() -> None:
    keys = {key for example in EXAMPLES for key in json.loads(example)}
    options = {"mode", "starts", "waist", "left_elbow", "right_elbow", "weights", "collision"}
    assert {*options, "nearest", "verb", "stream", "budget_ms"} <= keys


def test_everything_exported_exists() -> None:
    assert [name for name in ik_proto.__all__ if not hasattr(ik_proto, name)] == []
