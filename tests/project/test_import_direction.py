"""Imports point one way: contract, client, simulator; contract, service. A client never imports the service."""

import ast
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[2]
ALLOWED = {
    "proto/ik_proto": {"ik_proto"},
    "clients/ik_client": {"ik_proto", "ik_client"},
    "clients/xr_client": {"ik_proto", "ik_client", "xr_client"},
    "clients/camera_client": {"ik_proto", "ik_client", "camera_client"},
    "clients/gamepad_client": {"ik_proto", "ik_client", "gamepad_client"},
    "sim_client": {"ik_proto", "ik_client", "sim_client"},
    "ik_service": {"ik_proto", "ik_service"},
}
OURS = set().union(*ALLOWED.values())


def imported_by(file: Path) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.split(".")[0])
    return found


@pytest.mark.parametrize(("package", "allowed"), ALLOWED.items(), ids=ALLOWED)
def test_a_package_imports_only_what_is_upstream(package: str, allowed: set[str]) -> None:
    files = list((REPO / package).rglob("*.py"))
    assert files
    astray = {file.name: imported_by(file) & OURS - allowed for file in files}
    assert {name: modules for name, modules in astray.items() if modules} == {}
