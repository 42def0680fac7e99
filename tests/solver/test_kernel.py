"""Which kernel serves, and a word on why.

Generated C where it can be built and agrees, the virtual machine otherwise. What is not about the G1 is tried on the
small made-up robot, whose kernel compiles faster.
"""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from ik_proto.robots import load_description
from ik_service import generated
from ik_service.compiler import Library
from ik_service.kernel import Functions, Kernel, agree, functions, load_kernel
from ik_service.preset import Preset
from ik_service.robot import Robot
from ik_service.solver import Collision, Mode, Solver


@pytest.fixture(scope="module")
def folder(c_kernel: Kernel, small_robot: Robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache that holds the small robot's kernel; skipped where there is no compiler."""
    folder = tmp_path_factory.mktemp("cache") / "kernels"
    kernel = load_kernel(small_robot, folder=folder)
    assert (kernel.kind, kernel.note) == ("c", "")
    return folder


def _functions(kernel: Kernel) -> Functions:
    return Functions(kernel.solve, kernel.attempt, kernel.solve_rows)


@pytest.mark.parametrize("mode", ["track", "reach"])
@pytest.mark.parametrize("collision", ["off", "report", "avoid"])
@pytest.mark.parametrize("name", ["openwbt", "precise"])
def test_compiled_kernel_agrees_with_the_virtual_machine(
    robot: Robot,
    vm_kernel: Kernel,
    c_kernel: Kernel,
    request: pytest.FixtureRequest,
    mode: Mode,
    collision: Collision,
    name: str,
) -> None:
    """In every mode and setting, waist and hints included; the last bits may differ, and grow in long descents."""
    assert (vm_kernel.kind, c_kernel.kind, c_kernel.note) == ("vm", "c", "")
    preset: Preset = request.getfixturevalue("preset" if name == "openwbt" else name)
    machine, compiled = Solver(robot, vm_kernel, preset), Solver(robot, c_kernel, preset)
    rng = np.random.default_rng(8)
    for k in range(25):
        q = rng.uniform(robot.lower, robot.upper)
        waist = rng.uniform(-0.2, 0.2, 3)
        start = q + rng.normal(0.0, 0.1, robot.nq)
        hints = (
            {"left_elbow": np.array([0.0, 0.6, -0.8, 1.0]), "weights": rng.uniform(0.3, 1.0, (2, 2))} if k % 2 else {}
        )
        ours, theirs = (
            solver.solve(*robot.fk(q, waist), start, mode=mode, collision=collision, waist=waist, starts=4, **hints)
            for solver in (machine, compiled)
        )
        assert ours.status is theirs.status
        assert (ours.start, ours.starts, ours.nearest) == (theirs.start, theirs.starts, theirs.nearest)
        assert np.allclose(ours.q, theirs.q, rtol=0.0, atol=1e-5)
        assert np.allclose(ours.tau, theirs.tau, rtol=0.0, atol=1e-4)
        assert np.allclose(ours.position_error, theirs.position_error, rtol=0.0, atol=1e-6)
        assert np.isclose(ours.clearance, theirs.clearance, rtol=0.0, atol=1e-5)


def test_second_load_comes_from_the_cache(small_robot: Robot, folder: Path) -> None:
    (built,) = folder.iterdir()
    written = built.stat().st_mtime_ns
    assert load_kernel(small_robot, folder=folder).kind == "c"
    assert [built] == list(folder.iterdir())
    assert built.stat().st_mtime_ns == written


def test_source_follows_the_robot(small_robot: Robot, make_robot: Callable[..., Path]) -> None:
    """And with it the name in the cache: see `compiler`."""
    same, other = (
        Robot.load(load_description(make_robot(replace_toml=change))) for change in (("", ""), ("0.02]", "0.03]"))
    )
    ours, twins, theirs = (generated.source("kernel", functions(robot)) for robot in (small_robot, same, other))
    assert ours == twins
    assert ours != theirs


def test_no_compiler_means_virtual_machine(small_robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    kernel = load_kernel(small_robot, folder=tmp_path / "kernels")
    assert kernel.kind == "vm"
    assert kernel.note == "no C compiler found (looked for $CC, cc, gcc, clang)"


def test_unloadable_library_means_virtual_machine(
    small_robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def nonsense(source: str, folder: Path | None) -> Generator[Callable[[], Library]]:
        (tmp_path / "kernel.so").write_text("not a library")
        yield lambda: Library(tmp_path / "kernel.so")

    monkeypatch.setattr(generated, "build", nonsense)
    kernel = load_kernel(small_robot)
    assert (kernel.kind, kernel.note) == ("vm", "the compiled kernel cannot be loaded")


def test_kernel_that_computes_something_else_is_not_used(
    small_robot: Robot, make_robot: Callable[..., Path], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As if the cache held the small robot's kernel under the name of that of a robot with a tool 1 mm longer."""
    other = Robot.load(load_description(make_robot(replace_toml=("[0.1, 0.0", "[0.101, 0.0"))))
    source = generated.source("kernel", functions(small_robot))
    monkeypatch.setattr(generated, "source", lambda *_: source)
    kernel = load_kernel(other, folder=folder)
    assert kernel.kind == "vm"
    assert kernel.note == "the compiled kernel computes something else than the virtual machine"


@pytest.mark.parametrize("excess", [0.0, 1e-12])
def test_agreement_includes_the_limits(
    small_robot: Robot, small_kernel: Kernel, make_robot: Callable[..., Path], excess: float
) -> None:
    """A kernel whose limits are wider by 1e-12 rad gives nearly the same answers, and is refused all the same."""
    limits = 'lower="-2" upper="2.5"'
    wider = f'lower="{-2.0 - excess:.15f}" upper="{2.5 + excess:.15f}"'
    other = Robot.load(load_description(make_robot((limits, wider))))
    assert agree(small_robot, _functions(small_kernel), functions(other)) == (excess == 0.0)


def test_refused_cache_still_gives_the_compiled_kernel(
    small_robot: Robot, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The library says why it did not use the cache, and the kernel hands that on."""
    built_by = generated.build

    @contextmanager
    def elsewhere(source: str, unused: Path | None) -> Generator[Callable[[], Library]]:
        with built_by(source, folder) as wait:
            yield lambda: Library(wait().path, "kernel cache not used: others can write to it")

    monkeypatch.setattr(generated, "build", elsewhere)
    kernel = load_kernel(small_robot)
    assert (kernel.kind, kernel.note) == ("c", "kernel cache not used: others can write to it")
