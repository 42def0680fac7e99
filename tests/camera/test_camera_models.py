"""The pose models: fetched and made once, checked always. npm's part is played, but for one test with the real one."""

import io
import stat
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camera_client import models
from camera_client.models import MODELS, ModelError, ensure_model, make_models
from camera_client.pose_library import mediapipe
from ik_client.npm_package import NpmError, fetch_package

PARTS = ("pose_detector.tflite", "pose_landmarks_detector.tflite")


def task(*contents: bytes, names: tuple[str, ...] = PARTS) -> bytes:
    """A `.task` file, by Python's own archiver."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in zip(names, contents, strict=True):
            archive.writestr(name, content)
    return file.getvalue()


@pytest.fixture
def fetched(monkeypatch) -> list[str]:
    """Plays npm, and what counts as published; what was fetched."""
    log: list[str] = []

    def fetch(name: str, version: str, members: list[str]) -> dict[str, bytes]:
        log.extend(members)
        return {member: member.encode() for member in members}

    monkeypatch.setattr(models, "fetch_package", fetch)
    monkeypatch.setattr(models, "with_normalisation", lambda model, mean, std: model + f" {mean} {std}".encode())
    digest = {member: models.hashlib.sha256(member.encode()).hexdigest() for member in models._SHA256}
    monkeypatch.setattr(models, "_SHA256", digest)
    return log


def one_line(error: pytest.ExceptionInfo[ModelError]) -> str:
    text = str(error.value)
    assert "\n" not in text
    return text


def test_a_model_is_made_once(tmp_path, fetched):
    first, second = ensure_model("lite", tmp_path / "new"), ensure_model("lite", tmp_path / "new")
    assert first == second
    assert len(fetched) == 2
    assert list((tmp_path / "new").iterdir()) == [first]
    with zipfile.ZipFile(first) as archive:
        assert archive.namelist() == list(PARTS)
        assert archive.read(PARTS[0]) == b"package/pose_solution_packed_assets.data 127.5 127.5"
        assert archive.read(PARTS[1]) == b"package/pose_landmark_lite.tflite 0.0 255.0"
        # MediaPipe maps the models from the file, so they must not be compressed.
        assert all(info.compress_type == zipfile.ZIP_STORED for info in archive.infolist())


def test_all_models_need_one_fetch(tmp_path, fetched):
    assert [ensure_model(name, tmp_path) for name in MODELS] == make_models(tmp_path)
    assert fetched[-4:] == list(models._SHA256)


def test_the_users_cache_is_where_they_are_kept_for_nobody_else(tmp_path, monkeypatch, fetched):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    file = ensure_model("full")
    assert file.parent == tmp_path / "cache" / "ik-camera"
    assert stat.S_IMODE(file.parent.stat().st_mode) == 0o700
    assert stat.S_IMODE(file.stat().st_mode) == 0o600


@pytest.mark.parametrize("name", MODELS)
def test_something_else_is_refused_and_not_kept(tmp_path, monkeypatch, name):
    """The real checksums: this content has others."""
    monkeypatch.setattr(models, "fetch_package", lambda name, version, members: dict.fromkeys(members, b"evil"))
    with pytest.raises(ModelError, match="not as it was published") as caught:
        ensure_model(name, tmp_path / "cache")
    one_line(caught)
    assert not (tmp_path / "cache").exists()


@pytest.mark.parametrize("part", range(2))
def test_each_part_is_checked(tmp_path, monkeypatch, fetched, part):
    member = (models._DETECTOR, models._LANDMARKS["full"])[part]
    monkeypatch.setitem(models._SHA256, member, "0" * 64)
    with pytest.raises(ModelError, match=member):
        ensure_model("full", tmp_path)


@pytest.mark.parametrize("damage", ["cut", "changed", "emptied"])
def test_a_damaged_file_is_made_anew(tmp_path, fetched, damage):
    file = ensure_model("full", tmp_path)
    whole = file.read_bytes()
    at = whole.index(b"0.0 255.0")
    damaged = {"cut": whole[: len(whole) // 2], "changed": whole[:at] + b"9" + whole[at + 1 :], "emptied": b""}
    file.write_bytes(damaged[damage])
    assert ensure_model("full", tmp_path).read_bytes() == whole


def test_without_npm_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ModelError, match=r"install npm; or give the path of a .* \.task file") as caught:
        ensure_model("full", tmp_path / "cache")
    one_line(caught)


def test_without_a_network_it_says_so(tmp_path, monkeypatch):
    def fetch(*_: object) -> dict[str, bytes]:
        raise NpmError("npm cannot fetch it: is there a network?")

    monkeypatch.setattr(models, "fetch_package", fetch)
    with pytest.raises(ModelError, match="network"):
        ensure_model("full", tmp_path)


def test_a_cache_that_cannot_be_written_is_one_line(tmp_path, fetched):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ModelError, match="cannot be kept in") as caught:
        ensure_model("full", tmp_path / "file" / "cache")
    one_line(caught)


def test_a_file_of_ones_own_is_taken_as_it_is(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    mine = tmp_path / "mine.task"
    mine.write_bytes(task(b"a", b"b"))
    assert ensure_model(mine) == mine
    assert ensure_model(str(mine)) == mine


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "there is no pose model"),
        (b"", "no whole .task file"),
        (b"PK nonsense", "no whole .task file"),
        (task(b"a", names=PARTS[:1]), "no whole .task file"),
        (task(b"a", b"b")[:-30], "no whole .task file"),
    ],
)
def test_what_is_no_model_is_one_line(tmp_path, content, said):
    file = tmp_path / "mine.task"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(ModelError, match=said) as caught:
        ensure_model(file)
    assert "lite, full, heavy" in one_line(caught)


@given(damage=st.data())
@settings(max_examples=100)
def test_a_damaged_archive_never_surprises(tmp_path_factory, damage):
    content = bytearray(task(b"first" * 9, b"second" * 9))
    for _ in range(damage.draw(st.integers(1, 4))):
        content[damage.draw(st.integers(0, len(content) - 1))] = damage.draw(st.integers(0, 255))
    file = tmp_path_factory.mktemp("damaged") / "mine.task"
    file.write_bytes(content)
    try:
        assert ensure_model(file) == file
    except ModelError as error:
        assert "\n" not in str(error)


def test_the_real_models_say_how_to_scale_colours_and_are_otherwise_as_published(npm, tmp_path, monkeypatch):
    """Read back by the schemas that MediaPipe reads with; really fetched, once."""
    tflite = mediapipe("mediapipe.tasks.metadata.schema_py_generated")
    metadata = mediapipe("mediapipe.tasks.metadata.metadata_schema_py_generated")
    members = [models._DETECTOR, models._LANDMARKS["lite"]]
    published = fetch_package(models.PACKAGE, models.VERSION, members)
    monkeypatch.setattr(models, "fetch_package", lambda *asked: published)
    file = ensure_model("lite", tmp_path)
    with zipfile.ZipFile(file) as archive:
        for member, part, scale in zip(members, PARTS, ((127.5, 127.5), (0.0, 255.0)), strict=True):
            before = tflite.ModelT.InitFromPackedBuf(published[member], 0)
            after = tflite.ModelT.InitFromPackedBuf(archive.read(part), 0)
            (entry,) = (entry for entry in after.metadata if entry.name == b"TFLITE_METADATA")
            written = metadata.ModelMetadataT.InitFromPackedBuf(bytes(after.buffers[entry.buffer].data), 0)
            (graph,) = written.subgraphMetadata
            (unit,) = graph.inputTensorMetadata[0].processUnits
            assert (unit.options.mean[0], unit.options.std[0]) == scale
            assert len(graph.outputTensorMetadata) == len(after.subgraphs[0].outputs)
            # What it computes: operators, tensors and weights.
            del after.buffers[entry.buffer]
            after.metadata.remove(entry)
            before.metadata = before.metadata or []
            assert plain(before) == plain(after)
    again = ensure_model("lite", tmp_path / "again")
    assert again.read_bytes() == file.read_bytes()


def plain(tree: object) -> object:
    """A flatbuffer's tree as something that can be compared."""
    if isinstance(tree, list):
        return [plain(part) for part in tree]
    if hasattr(tree, "__dict__"):
        return {name: plain(part) for name, part in vars(tree).items()}
    return tree.tobytes() if isinstance(tree, np.ndarray) else tree
