"""`Engine`: which preset is the default, and mistakes in one line."""

import shutil
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import pytest

from ik_proto.robots import RobotError, load_description
from ik_service.config import Config, ConfigError
from ik_service.engine import Engine
from ik_service.robot import Robot
from ik_service.velocity_kernel import VelocityKernel
from ik_service.velocity_law import velocity_law

Rewritten = Callable[..., Path]


@pytest.fixture
def rewritten(tmp_path: Path) -> Rewritten:
    """The G1 with other presets: a path for `--robot`."""
    source = load_description("g1")

    def make(*presets: str) -> Path:
        text = source.source.read_text()
        weights = "position = 50.0\nrotation = 1.0\nregularization = 0.02\nsmoothness = 0.1\n"
        begin, end = text.index("[presets.openwbt]"), text.index("# Capsules that cover")
        mine = "".join(f"[presets.{name}]\n{weights}\n" for name in presets)
        shutil.copy(source.model, tmp_path)
        (tmp_path / "other.toml").write_text(text[:begin] + mine + text[end:])
        return tmp_path / "other.toml"

    return make


def build(robot: str | Path, preset: str = "") -> Engine:
    return Engine.build(Config(robot=str(robot), preset=preset, kernel="vm"), "", "")


def test_it_is_compiled_only_where_both_kernels_are(kernel_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A rate control that fell back to the virtual machine is told, and refused where that was not asked for."""

    @contextmanager
    def interpreted(robot: Robot, compiled: bool) -> Generator[Callable[[], VelocityKernel]]:
        assert compiled
        yield lambda: VelocityKernel(velocity_law(robot), "vm", "a word on why")

    monkeypatch.setenv("IK_CACHE_DIR", str(kernel_cache))
    both = Engine.build(Config(), "", "")
    monkeypatch.setattr("ik_service.engine.building_velocity_kernel", interpreted)
    one = Engine.build(Config(), "", "")
    assert (one.about.kernel, one.kernel_note) == ("vm", both.kernel_note or "a word on why")
    if both.about.kernel == "c":
        with pytest.raises(ConfigError, match=r"^--kernel c is not possible here: a word on why$"):
            Engine.build(Config(kernel="c"), "", "")


def test_precise_is_the_default(engine: Engine) -> None:
    assert engine.about.default_preset == "precise"
    assert sorted(engine.solvers) == ["openwbt", "precise"]
    assert engine.collision == "avoid"


def test_the_only_preset_of_a_robot_is_its_default(rewritten: Rewritten) -> None:
    assert build(rewritten("gentle")).about.default_preset == "gentle"


@pytest.mark.parametrize(
    ("presets", "words"),
    [
        (["gentle", "brisk"], "robot g1 has no preset precise: name one with --preset (brisk, gentle)"),
        ([], "robot g1 has no preset precise: name one with --preset (none)"),
    ],
)
def test_where_it_is_not_plain_which_one_is_meant_it_must_be_named(
    rewritten: Rewritten, presets: list[str], words: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        build(rewritten(*presets))
    assert str(caught.value) == words


@pytest.mark.parametrize(("presets", "preset"), [(["gentle"], "precise"), (["gentle", "precise"], "brisk")])
def test_a_preset_that_was_named_must_be_there(rewritten: Rewritten, presets: list[str], preset: str) -> None:
    with pytest.raises(RobotError, match=f"no preset {preset}; it has gentle"):
        build(rewritten(*presets), preset)


def test_a_copy_answers_the_same_and_shares_no_buffers(engine: Engine) -> None:
    copy = engine.copy()
    assert copy.about is engine.about
    assert copy.collision == engine.collision
    assert copy.robot is not engine.robot
    assert copy.gauge is not engine.gauge
    for name, solver in engine.solvers.items():
        assert copy.solvers[name] is not solver
        assert copy.solvers[name].kernel is solver.kernel
        assert copy.solvers[name].preset == solver.preset
