"""Log lines: a JSON object for machines, one line of text for people, tracebacks whole in both."""

import json
import logging
from collections.abc import Iterator

import pytest

from ik_service.logs import configure_logs, is_json, log, values


@pytest.fixture(autouse=True)
def _restored() -> Iterator[None]:
    """Leave the package's logger as it was found."""
    handlers, propagate, level = log.handlers, log.propagate, log.level
    yield
    log.handlers, log.propagate = handlers, propagate
    log.setLevel(level)


def log_some() -> None:
    log.debug("not written")
    log.warning("kernel", extra=values(kind="vm", seconds=0.5))
    try:
        raise RuntimeError("broken")
    except RuntimeError:
        log.exception("request failed")


def test_json_lines(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logs("json", "info")
    log_some()
    first, second = map(json.loads, capsys.readouterr().err.splitlines())
    assert first.pop("timestamp").endswith("Z")
    assert first == {"event": "kernel", "level": "warning", "kind": "vm", "seconds": 0.5}
    assert second["event"] == "request failed"
    assert "RuntimeError: broken" in second["exception"]


def test_console_lines(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logs("console", "info")
    log_some()
    text = capsys.readouterr().err
    assert "warning kernel  kind=vm  seconds=0.5\n" in text
    assert "RuntimeError: broken" in text
    assert "not written" not in text


def test_the_level_is_kept(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logs("console", "error")
    log_some()
    assert "kernel" not in capsys.readouterr().err
    assert log.level == logging.ERROR


def test_auto_means_json_where_nobody_watches() -> None:
    assert is_json("auto")
    assert is_json("json")
    assert not is_json("console")
