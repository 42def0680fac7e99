"""Structured logs on standard error: JSON lines for machines, plain text for a terminal.

An event is a fixed sentence; what varies goes into named values: `log.warning("kernel", extra=values(kind="vm"))`.
Python's own logging does it: a package that does more takes 0.3 s to import, a sixth of what a start may take.
"""

import json
import logging
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

log = logging.getLogger("ik_service")
"""The logger of the whole package."""


def values(**named: Any) -> dict[str, Mapping[str, Any]]:
    """Named values of an event, in the form `extra` takes."""
    return {"named": named}


def is_json(log_format: str) -> bool:
    """Decide what "auto" means: JSON unless a person is watching standard error."""
    return log_format == "json" or (log_format == "auto" and not sys.stderr.isatty())


def configure_logs(log_format: str, level: str) -> None:
    """Send the package's log to standard error.

    Args:
        log_format: "json", "console" or "auto".
        level: Least severe level to write: "debug", "info", "warning" or "error".
    """
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_JsonFormatter() if is_json(log_format) else _ConsoleFormatter())
    log.handlers = [handler]
    log.propagate = False
    log.setLevel(level.upper())


def _named(record: logging.LogRecord) -> Mapping[str, Any]:
    return getattr(record, "named", {})


def _timestamp(record: logging.LogRecord) -> str:
    return datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


class _JsonFormatter(logging.Formatter):
    """One JSON object a line; a traceback is one of its values."""

    def format(self, record: logging.LogRecord) -> str:
        entry = {"event": record.getMessage(), "level": record.levelname.lower(), "timestamp": _timestamp(record)}
        entry |= _named(record)
        if record.exc_info:
            entry["exception"] = self.formatException(record.exc_info)
        return json.dumps(entry, default=str)


class _ConsoleFormatter(logging.Formatter):
    """Time, level, event, then `name=value` pairs; a traceback below."""

    def format(self, record: logging.LogRecord) -> str:
        pairs = "".join(f"  {name}={value}" for name, value in _named(record).items())
        line = f"{_timestamp(record)[11:-1]} {record.levelname.lower():<8}{record.getMessage()}{pairs}"
        return f"{line}\n{self.formatException(record.exc_info)}" if record.exc_info else line
