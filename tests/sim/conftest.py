"""Fixtures of the simulator's tests."""

from pathlib import Path

import pytest
from sim_fakes import TOY_MODEL, TOY_TOML

from ik_proto.robots import RobotDescription, load_description
from sim_client.arms import ArmKinematics


@pytest.fixture(scope="session")
def g1() -> RobotDescription:
    return load_description("g1")


@pytest.fixture(scope="session")
def g1_arms(g1: RobotDescription) -> ArmKinematics:
    return ArmKinematics(g1)


@pytest.fixture
def toy_files(tmp_path: Path) -> tuple[Path, Path]:
    """Description and model file of a small two-armed robot, to be edited."""
    toml, model = tmp_path / "toy.toml", tmp_path / "toy.xml"
    toml.write_text(TOY_TOML)
    model.write_text(TOY_MODEL)
    return toml, model


@pytest.fixture
def toy(toy_files: tuple[Path, Path]) -> RobotDescription:
    return load_description(toy_files[0])
