"""Which kernel serves, and a word on why.

Generated C where it can be built and agrees, the virtual machine otherwise.
"""

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ik_service import kernel as kernel_module
from ik_service.compiler import Library
from ik_service.descent import descent
from ik_service.kernel import Kernel, agree, load_kernel
from ik_service.objective import Preset
from ik_service.robot import Robot


def test_compiled_kernel_agrees_with_the_virtual_machine(robot: Robot, vm_kernel: Kernel, c_kernel: Kernel) -> None:
    assert (vm_kernel.kind, c_kernel.kind, c_kernel.note) == ("vm", "c", "")
    rng = np.random.default_rng(8)
    for arm, ours, theirs in zip(robot.arms, vm_kernel.descents, c_kernel.descents, strict=True):
        for _ in range(200):
            q = rng.uniform(arm.lower, arm.upper)
            start = q + rng.normal(0.0, 0.2, len(q))
            (a, report_a, tau_a), (b, report_b, tau_b) = (f(start, arm.wrist(q), start, 0.0) for f in (ours, theirs))
            assert np.allclose(np.array(a), np.array(b), atol=1e-7)
            assert np.allclose(np.array(report_a)[:4], np.array(report_b)[:4], atol=1e-7)
            assert np.allclose(np.array(tau_a), np.array(tau_b), atol=1e-7)


def test_second_load_comes_from_the_cache(
    robot: Robot, preset: Preset, c_kernel: Kernel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "kernels"
    assert load_kernel(robot, preset, folder=folder).kind == "c"
    (built,) = folder.iterdir()
    written = built.stat().st_mtime_ns
    assert load_kernel(robot, preset, folder=folder).kind == "c"
    assert [built] == list(folder.iterdir())
    assert built.stat().st_mtime_ns == written
    load_kernel(robot, replace(preset, smoothness=0.2), folder=folder)
    assert len(list(folder.iterdir())) == 2


def test_no_compiler_means_virtual_machine(
    robot: Robot, preset: Preset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    kernel = load_kernel(robot, preset, folder=tmp_path / "kernels")
    assert kernel.kind == "vm"
    assert kernel.note == "no C compiler found (looked for $CC, cc, gcc, clang)"


def test_unloadable_library_means_virtual_machine(
    robot: Robot, preset: Preset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def nonsense(source: str, folder: Path | None) -> Generator[Library]:
        (tmp_path / "kernel.so").write_text("not a library")
        yield Library(tmp_path / "kernel.so")

    monkeypatch.setattr(kernel_module, "library", nonsense)
    kernel = load_kernel(robot, preset)
    assert (kernel.kind, kernel.note) == ("vm", "the compiled kernel cannot be loaded")


def test_kernel_that_computes_something_else_is_not_used(
    robot: Robot, preset: Preset, c_kernel: Kernel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As if the cache held a kernel of other weights under this kernel's name."""
    other = replace(preset, position=preset.position * 1.01)
    arms = robot.arms
    stale = (descent(arms[0], other, "left_descent"), descent(arms[1], other, "right_descent"))
    source = kernel_module._source(stale)
    monkeypatch.setattr(kernel_module, "_source", lambda _: source)
    kernel = load_kernel(robot, preset, folder=tmp_path / "kernels")
    assert kernel.kind == "vm"
    assert kernel.note == "the compiled kernel of the left arm computes something else"


@pytest.mark.parametrize("excess", [0.0, 1e-12])
def test_agreement_includes_the_limits(robot: Robot, preset: Preset, vm_kernel: Kernel, excess: float) -> None:
    """A kernel whose limits are wider by 1e-12 rad gives nearly the same answers, and is refused all the same."""
    arm = robot.arms[0]
    wider = descent(replace(arm, lower=arm.lower - excess, upper=arm.upper + excess), preset, "wider")
    assert agree(arm, vm_kernel.descents[0], wider) == (excess == 0.0)


def test_refused_cache_still_gives_the_compiled_kernel(
    robot: Robot, preset: Preset, c_kernel: Kernel, tmp_path: Path
) -> None:
    folder = tmp_path / "kernels"
    folder.mkdir()
    folder.chmod(0o777)
    kernel = load_kernel(robot, preset, folder=folder)
    assert kernel.kind == "c"
    assert kernel.note == f"kernel cache {folder} not used: others can write to it (chmod 700 it)"
    assert list(folder.iterdir()) == []
