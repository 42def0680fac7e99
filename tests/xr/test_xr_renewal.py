"""Certificates that are renewed while a server runs, with a clock of ours."""

import datetime
from typing import Any

import pytest

from xr_client.certificates import LEAF_DAYS, Credentials, certificate_fault, ensure_credentials
from xr_client.renewal import Renewal


class World:
    """A machine: its date, its addresses, its certificates."""

    def __init__(self, folder) -> None:
        self.folder = folder
        self.now = datetime.datetime.now(datetime.UTC)
        self.hosts = ["192.168.1.20"]
        self.taken: list[tuple[Credentials, Any]] = []
        self.refuses = ""
        made = ensure_credentials(folder, self.hosts, [], self.now)
        self.renewal = Renewal(folder, made, lambda: self.hosts, [], self.take, now=lambda: self.now)

    def take(self, made: Credentials, hosts: Any) -> None:
        if self.refuses:
            raise OSError(self.refuses)
        self.taken.append((made, list(hosts)))

    def pass_days(self, number: float) -> None:
        self.now += datetime.timedelta(days=number)


@pytest.fixture
def world(tmp_path) -> World:
    return World(tmp_path / "certificates")


def test_what_is_good_stays(world):
    world.pass_days(LEAF_DAYS - 31)
    assert not world.renewal.check()
    assert world.taken == []


def test_thirty_days_before_it_expires_it_is_renewed_once(world):
    world.pass_days(LEAF_DAYS - 29)
    assert world.renewal.check()
    assert not world.renewal.check()
    ((made, hosts),) = world.taken
    assert hosts == world.hosts
    world.pass_days(60)
    assert certificate_fault(made.leaf, world.hosts[0], world.now) is None


def test_another_address_is_taken_up_and_a_lost_one_is_not_minded(world):
    world.hosts = ["10.0.0.7"]
    assert world.renewal.check()
    world.hosts = []
    assert not world.renewal.check()
    assert [hosts for _, hosts in world.taken] == [["10.0.0.7"]]


def test_what_another_process_has_renewed_is_taken_up(world):
    ensure_credentials(world.folder, ["10.0.0.7"], [], world.now)
    world.hosts = ["10.0.0.7"]
    assert world.renewal.check()
    assert len(world.taken) == 1


def test_what_fails_is_told_and_tried_again(world):
    world.hosts = ["10.0.0.7"]
    world.refuses = "no such luck"
    assert not world.renewal.check()
    assert world.renewal.fault == "no such luck"
    world.refuses = ""
    assert world.renewal.check()
    assert world.renewal.fault == ""
    (world.folder / "ca.key").chmod(0o644)
    assert not world.renewal.check()
    assert "chmod 600" in world.renewal.fault
