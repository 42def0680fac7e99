"""What the tests of the XR client share."""

import os
from collections.abc import Iterator

import numpy as np
import pytest
from chromium import Chromium, Tab, executable
from xr_page import PageServer, enter, settle
from xr_samples import read_hand

from xr_client.iwer import EmulatorError, iwer_script


@pytest.fixture(params=["pinch", "point", "relaxed"])
def captured_hand(shared_data, request) -> tuple[str, np.ndarray]:
    """Name and joints, shape (25, 4, 4), of a hand that a real headset saw."""
    return request.param, read_hand(shared_data / "human" / "webxr_hands" / f"{request.param}.js")


@pytest.fixture(scope="session")
def chromium() -> Iterator[Chromium]:
    """A browser without a screen; where there is none the test is skipped, but not in CI."""
    if executable() is None and not os.environ.get("CI"):
        pytest.skip("no Chromium: on Debian or Ubuntu, apt install chromium")
    browser = Chromium()
    yield browser
    browser.close()


@pytest.fixture(scope="session")
def iwer() -> str:
    """The emulated headset's script; where it cannot be had the test is skipped, but not in CI."""
    try:
        return iwer_script().read_text()
    except EmulatorError as error:
        if os.environ.get("CI"):
            raise
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def worn_page(chromium, iwer) -> Iterator[tuple[PageServer, Tab]]:
    """A server, and a tab in whose page a headset is worn. Not for longer than a module: it draws all the time."""
    server = PageServer(emulator=iwer_script())
    server.start()
    with chromium.tab() as tab:
        enter(tab, server)
        yield server, tab
    server.stop()


@pytest.fixture
def worn(worn_page) -> tuple[PageServer, Tab]:
    """A server, and a tab in whose page a headset is worn: two open hands before the chest, a level head."""
    settle(*worn_page)
    return worn_page
