"""Fixtures with a rig in a browser; a test module takes them by `pytest_plugins = ["picture_fixtures"]`."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from chromium import Chromium
from picture_rig import Rig
from xr_page import PageServer

from xr_client.pages import WEB


@pytest.fixture(scope="session")
def picture_folder(tmp_path_factory) -> Path:
    """The page's modules beside a page that is the rig."""
    folder = tmp_path_factory.mktemp("picture")
    for file in [*WEB.glob("*.js"), Path(__file__).with_name("picture_rig.js")]:
        shutil.copy(file, folder)
    (folder / "index.html").write_text(
        '<!doctype html><link rel="icon" href="data:,"><script type="module" src="/picture_rig.js"></script><body>'
    )
    return folder


@pytest.fixture(scope="session")
def picture_host(picture_folder: Path) -> Iterator[PageServer]:
    """A server of them."""
    host = PageServer(folder=picture_folder)
    host.start()
    yield host
    host.stop()


@pytest.fixture(scope="session")
def used_rig(chromium: Chromium, picture_host: PageServer) -> Iterator[Rig]:
    """A rig in whatever state: for functions that have none."""
    with chromium.tab() as tab:
        rig = Rig(tab, picture_host)
        rig.open()
        yield rig


@pytest.fixture
def rig(used_rig: Rig) -> Rig:
    """A rig as it is at the beginning."""
    used_rig.tab.console.clear()
    used_rig.open()
    return used_rig
