"""The states of a robot's own end, as one table.

| state     | the arms                                                                                          |
|-----------|---------------------------------------------------------------------------------------------------|
| released  | are the onboard controller's, weight 0. The state after every start                               |
| taking    | stay where they were taken, while the weight rises to 1                                           |
| ready     | brake within their limits and hold, weight 1; commands are not followed                           |
| following | follow commands within their limits                                                               |
| holding   | brake within their limits and hold for a moment; the next fresh command goes on                   |
| releasing | brake within their limits and hold, while the weight sinks to 0                                   |

What happens to it, the first that applies counts:

| event      | when                                                                                             |
|------------|--------------------------------------------------------------------------------------------------|
| release    | the source, or the end of the program, gives the arms back                                       |
| disengaged | a command says that no operator has engaged an arm                                               |
| restarted  | the commands that are followed begin to come from another run of the IK service                  |
| engaged    | commands begin to say that an arm is engaged, and agree with where the arms are held             |
| fresh      | any other command                                                                                |
| agrees     | the command agrees with where the arms are measured; counts in released only                     |
| gone       | no command came for longer than a hold may last                                                  |
| silent     | no command came for longer than one may be late                                                  |
| ramped     | the weight has arrived                                                                           |

`TABLE` says where each event leads; an empty cell stays. A source that dies never leads to released: the arms hold.
"""

from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType

TABLE = """\
| from      | release   | disengaged | restarted | engaged   | fresh     | agrees | gone  | silent  | ramped   |
|-----------|-----------|------------|-----------|-----------|-----------|--------|-------|---------|----------|
| released  |           |            |           |           |           | taking |       |         |          |
| taking    | releasing |            |           |           |           |        |       |         | ready    |
| ready     | releasing |            |           | following |           |        |       |         |          |
| following | releasing | ready      | ready     |           |           |        | ready | holding |          |
| holding   | releasing | ready      | ready     |           | following |        | ready |         |          |
| releasing |           |            |           |           |           |        |       |         | released |
"""


class EndState(StrEnum):
    """What the robot's own end does."""

    RELEASED = "released"
    TAKING = "taking"
    READY = "ready"
    FOLLOWING = "following"
    HOLDING = "holding"
    RELEASING = "releasing"


class EndEvent(StrEnum):
    """What happens to it, in order of precedence."""

    RELEASE = "release"
    DISENGAGED = "disengaged"
    RESTARTED = "restarted"
    ENGAGED = "engaged"
    FRESH = "fresh"
    AGREES = "agrees"
    GONE = "gone"
    SILENT = "silent"
    RAMPED = "ramped"


def _parse(table: str) -> Mapping[EndState, Mapping[EndEvent, EndState]]:
    head, _, *rows = ([cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines())
    events = [EndEvent(name) for name in head[1:]]
    return MappingProxyType(
        {
            EndState(row[0]): MappingProxyType(
                {event: EndState(to or row[0]) for event, to in zip(events, row[1:], strict=True)}
            )
            for row in rows
        }
    )


TRANSITIONS = _parse(TABLE)
"""`TABLE` as a mapping: state and event to the next state. Complete."""
