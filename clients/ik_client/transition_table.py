"""A state machine as one table: test data, documentation, and what runs.

    | from | first event | second event |
    |------|-------------|--------------|
    | here | there       |              |

An empty cell stays.
"""

from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType
from typing import TypeVar

S = TypeVar("S", bound=StrEnum)
E = TypeVar("E", bound=StrEnum)


def read_table(table: str, states: type[S], events: type[E]) -> Mapping[S, Mapping[E, S]]:
    """Read a table.

    Args:
        table: Markdown, with the events in the first line and a state at the beginning of each of the others.
        states: The words for states.
        events: The words for events.

    Returns:
        State and event to the next state.

    Raises:
        ValueError: A word is neither, or a line is too short or too long.
    """
    head, _, *rows = ([cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines())
    named = [events(name) for name in head[1:]]
    return MappingProxyType(
        {
            states(row[0]): MappingProxyType(
                {event: states(to or row[0]) for event, to in zip(named, row[1:], strict=True)}
            )
            for row in rows
        }
    )
