"""What can be tested of the containers without an engine: files parse, and what they name exists."""

import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

REPO = Path(__file__).resolve().parents[2]
COMPOSE = yaml.safe_load((REPO / "docker-compose.yml").read_text())
DOCKERFILE = (REPO / "Dockerfile").read_text().replace("\\\n", " ")
SCRIPTS_FOLDER = Path(sys.executable).parent
SCRIPTS = tomllib.loads((REPO / "pyproject.toml").read_text())["project"]["scripts"]


def commands() -> list[list[str]]:
    """Every console script with its options, from the compose file and the image."""
    found = [service["command"] for service in COMPOSE["services"].values()]
    lines = re.findall(r"^\s*(?:CMD|ENTRYPOINT|HEALTHCHECK.*?CMD) (\[.*\])", DOCKERFILE, re.MULTILINE)
    return found + [yaml.safe_load(line) for line in lines]


@pytest.mark.parametrize("command", commands(), ids=shlex.join)
def test_every_command_and_option_exists(command: list[str]) -> None:
    program, *rest = command
    assert program in SCRIPTS
    subcommand = [rest[0]] if rest and not rest[0].startswith(("-", "tcp:", "zenoh:")) else []
    usage = subprocess.run(
        [SCRIPTS_FOLDER / program, *subcommand, "--help"], capture_output=True, text=True, check=True
    ).stdout
    for option in (part for part in rest if part.startswith("--")):
        assert re.search(rf"(?<![\w-]){re.escape(option)}(?![\w-])", usage), option


def test_there_are_commands_to_check() -> None:
    assert {command[0] for command in commands()} == {"ik-service", "ik-sim"}
    assert ["ik-service", "healthcheck"] in commands()


def test_the_image_copies_what_exists_and_packages_need() -> None:
    copied = re.findall(r"^COPY (.+) \S+$", DOCKERFILE, re.MULTILINE)
    sources = {name for line in copied for name in line.split()}
    assert all((REPO / source).exists() for source in sources)
    packages = tomllib.loads((REPO / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"][
        "packages"
    ]
    assert {package.split("/")[0] for package in packages} <= sources
    assert {"LICENSE", "NOTICE", "README.md", "pyproject.toml"} <= sources


def test_services_refer_to_each_other_by_name() -> None:
    services = COMPOSE["services"]
    sim = services["ik-sim"]
    assert sim["network_mode"] == "service:ik-service"
    assert set(sim["depends_on"]) <= set(services)
    volumes = {volume.split(":")[0] for service in services.values() for volume in service.get("volumes", [])}
    assert volumes == set(COMPOSE["volumes"])
