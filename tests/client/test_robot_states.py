"""The states of the robot's end: the table is the test data; the rules it must obey are written down apart from it."""

import itertools

import pytest

from ik_client.robot_end.states import TABLE, TRANSITIONS, EndEvent, EndState

HEAD, _, *ROWS = ([cell.strip() for cell in line.strip("|").split("|")] for line in TABLE.splitlines())
CELLS = {(EndState(row[0]), EndEvent(name)): cell for row in ROWS for name, cell in zip(HEAD[1:], row[1:], strict=True)}
OF_A_SOURCE_THAT_DIES = (EndEvent.GONE, EndEvent.SILENT, EndEvent.RAMPED)


def reachable(start: EndState, events) -> set[EndState]:
    found, edge = {start}, [start]
    while edge:
        state = edge.pop()
        new = {TRANSITIONS[state][event] for event in events} - found
        found |= new
        edge += new
    return found


def test_the_table_is_complete():
    assert set(CELLS) == set(itertools.product(EndState, EndEvent))


@pytest.mark.parametrize(("state", "event"), CELLS, ids=[f"{s}-{e}" for s, e in CELLS])
def test_every_cell(state, event):
    assert TRANSITIONS[state][event] is EndState(CELLS[state, event] or state)


@pytest.mark.parametrize("state", sorted(set(EndState) - {EndState.RELEASING, EndState.RELEASED}))
def test_a_source_that_dies_never_leads_to_released(state):
    """Hazard row "lost connection": hold, never go home."""
    assert not reachable(state, OF_A_SOURCE_THAT_DIES) & {EndState.RELEASING, EndState.RELEASED}


@pytest.mark.parametrize("state", sorted(set(EndState) - {EndState.FOLLOWING, EndState.HOLDING}))
def test_following_begins_with_an_engagement_only(state):
    """Hazard rows "service restart" and "deadman release", at the robot."""
    others = [event for event in EndEvent if event is not EndEvent.ENGAGED]
    assert not reachable(state, others) & {EndState.FOLLOWING, EndState.HOLDING}


def test_the_arms_are_given_back_through_releasing_only():
    into = {state for state in EndState for event in EndEvent if TRANSITIONS[state][event] is EndState.RELEASED}
    assert into == {EndState.RELEASED, EndState.RELEASING}
    assert TRANSITIONS[EndState.RELEASING] == {
        event: EndState.RELEASED if event is EndEvent.RAMPED else EndState.RELEASING for event in EndEvent
    }


def test_every_state_is_reached_and_left():
    assert reachable(EndState.RELEASED, EndEvent) == set(EndState)
    assert all(reachable(state, EndEvent) == set(EndState) for state in EndState)
