"""The built wheel, in an environment of its own: a thin client that needs four packages and loads nothing heavy."""

import os
import subprocess
import venv
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[2]
HEAVY = ("pinocchio", "casadi", "mujoco", "rich", "aiohttp", "imageio", "zenoh", "pygame", "evdev", "ruckig")


def run(*command: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
    return subprocess.run(
        [str(part) for part in command], cwd=cwd, env=environment, capture_output=True, text=True, timeout=240
    )


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A new environment with the wheel and its base dependencies."""
    folder = tmp_path_factory.mktemp("wheel")
    venv.create(folder / "env", with_pip=True)
    pip = [folder / "env" / "bin" / "python", "-m", "pip", "--disable-pip-version-check", "-q"]
    built = run(*pip, "wheel", "--no-deps", "-w", folder, REPO, cwd=folder)
    if built.returncode and "CI" not in os.environ:
        pytest.skip(f"cannot build here: {built.stderr.strip().splitlines()[-1]}")
    assert built.returncode == 0, built.stderr
    (wheel,) = folder.glob("ik_service-*.whl")
    installed = run(*pip, "install", "--no-compile", wheel, cwd=folder)
    assert installed.returncode == 0, installed.stderr
    return folder


@pytest.mark.timeout(600)
def test_the_client_imports_alone_and_loads_nothing_heavy(clean: Path) -> None:
    code = f"import sys, ik_client; print([name for name in {HEAVY!r} if name in sys.modules])"
    result = run(clean / "env/bin/python", "-c", code, cwd=clean)
    assert result.stdout.strip() == "[]", result.stderr


def test_the_base_install_is_thin(clean: Path) -> None:
    result = run(clean / "env/bin/python", "-m", "pip", "list", "--format=freeze", cwd=clean)
    installed = {line.split("==")[0].lower() for line in result.stdout.split()}
    assert installed - {"pip", "setuptools", "wheel"} == {"ik-service", "numpy", "msgpack", "orjson", "eclipse-zenoh"}


def test_the_robot_ships_inside(clean: Path) -> None:
    code = "from ik_proto.robots import load_description as d; r = d('g1'); print(len(r.arm_joints), r.model.is_file())"
    assert run(clean / "env/bin/python", "-c", code, cwd=clean).stdout.split() == ["14", "True"]


@pytest.mark.parametrize(
    ("command", "extra"),
    [("ik-service", "service"), ("ik-sim", "sim"), ("ik-load", "load"), ("ik-demo", "sim"), ("ik-gamepad", "gamepad")],
)
def test_a_missing_extra_gets_one_line(clean: Path, command: str, extra: str) -> None:
    arguments = {"ik-service": ["serve"], "ik-load": ["tcp://127.0.0.1:1"]}.get(command, [])
    result = run(clean / "env/bin" / command, *arguments, cwd=clean)
    lines = result.stderr.strip().splitlines()
    assert result.returncode == 2, result
    assert len(lines) == 1
    assert f"ik-service[{extra}" in lines[0]


def test_help_needs_no_extra(clean: Path) -> None:
    for command in ("ik-service", "ik-sim", "ik-load", "ik-demo", "ik-gamepad"):
        result = run(clean / "env/bin" / command, "--help", cwd=clean)
        assert result.returncode == 0, result.stderr
        assert "usage" in result.stdout.lower()
