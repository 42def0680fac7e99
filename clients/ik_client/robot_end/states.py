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

from enum import StrEnum

from ik_client.transition_table import read_table

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


TRANSITIONS = read_table(TABLE, EndState, EndEvent)
"""`TABLE` as a mapping: state and event to the next state. Complete."""
