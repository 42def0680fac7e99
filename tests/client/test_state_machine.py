"""The state machine: the table is the test data, and the rules it must obey are written down apart from it."""

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_client.hold_to_run import Grip
from ik_client.state_machine import TABLE, TRANSITIONS, ArmState, Event, Seen, StateMachine

GOOD = Seen(Grip.HELD, followable=True, aligned=True)
CHANGES: dict[Event, dict[str, Any]] = {
    Event.FAULT: {"fault": True},
    Event.CLEAR: {"clear": True},
    Event.REVOKED: {"revoked": True},
    Event.RELEASED: {"grip": Grip.RELEASED},
    Event.LOST: {"followable": False},
    Event.PRESSED: {"grip": Grip.PRESSED},
    Event.ALIGNED: {},
    Event.HELD: {"aligned": False},
}
SEEN = {event: replace(GOOD, **change) for event, change in CHANGES.items()}
CELLS = [
    (ArmState(line.split("|")[1].strip()), Event(name), cell.strip())
    for line in TABLE.splitlines()[2:]
    for name, cell in zip(
        (name.strip() for name in TABLE.splitlines()[0].split("|")[2:-1]), line.split("|")[2:-1], strict=True
    )
]


def at(state: ArmState, now: float = 0.0) -> StateMachine:
    machine = StateMachine()
    machine.state, machine._since = state, now
    return machine


def test_the_table_is_complete():
    assert len(CELLS) == len(ArmState) * len(Event)
    assert {(state, event) for state, event, _ in CELLS} == set(itertools.product(ArmState, Event))


@pytest.mark.parametrize(("state", "event", "to"), CELLS, ids=[f"{s}-{e}" for s, e, _ in CELLS])
def test_every_cell(state, event, to):
    machine = at(state)
    assert machine.step(event, 0.1) is (ArmState(to) if to else state)
    assert machine.state is TRANSITIONS[state][event]


@pytest.mark.parametrize("event", SEEN)
def test_every_event_is_seen_and_takes_precedence_over_those_after_it(event):
    order = list(Event)
    state = ArmState.FAULT if event is Event.CLEAR else ArmState.ACTIVE
    assert at(state).event(SEEN[event], 0.0) is event
    # ALIGNED and HELD exclude each other, so neither precedes the other.
    for later in order[order.index(event) + 1 : -1]:
        both = replace(SEEN.get(later, GOOD), **CHANGES[event])
        assert at(state).event(both, 0.0) is event


def test_a_timeout_takes_precedence_over_the_hand_but_not_over_a_fault():
    for state, limit in StateMachine().time_limits.items():
        assert at(state).event(SEEN[Event.ALIGNED], limit + 1e-9) is Event.TIMEOUT
        assert at(state).event(SEEN[Event.PRESSED], limit + 1e-9) is Event.TIMEOUT
        assert at(state).event(SEEN[Event.ALIGNED], limit) is Event.ALIGNED
        assert at(state).event(SEEN[Event.REVOKED], limit + 1e-9) is Event.REVOKED
        assert at(state, now=10.0).event(SEEN[Event.ALIGNED], 9.0) is Event.TIMEOUT  # a clock that stepped back
        assert at(state).event(SEEN[Event.ALIGNED], float("nan")) is Event.TIMEOUT


def test_states_without_a_limit_last():
    for state in (ArmState.DISARMED, ArmState.ACTIVE, ArmState.FAULT):
        assert at(state).event(SEEN[Event.ALIGNED], 1e9) is Event.ALIGNED


def test_clearing_counts_in_fault_only():
    for state in set(ArmState) - {ArmState.FAULT}:
        assert at(state).event(SEEN[Event.CLEAR], 0.0) is Event.ALIGNED
        assert at(state).event(replace(SEEN[Event.REVOKED], clear=True), 0.0) is Event.REVOKED


def test_only_these_events_leave_an_arm_active():
    """The rule in words: it moves after a grip and an alignment, or goes on after a moment with the grip held."""
    ways_in = {(s, e) for s, row in TRANSITIONS.items() for e, to in row.items() if to is ArmState.ACTIVE is not s}
    assert ways_in == {
        (ArmState.ALIGNING, Event.ALIGNED),
        (ArmState.HOLD, Event.ALIGNED),
        (ArmState.HOLD, Event.HELD),
    }
    stays = {e for e, to in TRANSITIONS[ArmState.ACTIVE].items() if to is ArmState.ACTIVE}
    # The machine sees neither a clearing nor a timeout in ACTIVE.
    assert stays - {Event.CLEAR, Event.TIMEOUT} == {Event.ALIGNED, Event.HELD}
    assert {e for s in ArmState for e, to in TRANSITIONS[s].items() if to is ArmState.ALIGNING is not s} == {
        Event.PRESSED
    }
    assert {to for e, to in TRANSITIONS[ArmState.FAULT].items() if e is not Event.CLEAR} == {ArmState.FAULT}


SEENS = st.builds(
    Seen,
    grip=st.sampled_from(Grip),
    followable=st.booleans(),
    aligned=st.booleans(),
    revoked=st.booleans(),
    fault=st.booleans(),
    clear=st.booleans(),
)


@given(st.lists(st.tuples(SEENS, st.floats(0.0, 0.3)), max_size=40))
def test_whatever_happens_the_rules_hold(ticks):
    machine, now = StateMachine(), 0.0
    history = [ArmState.DISARMED]
    pressed = False
    hold_began = None
    for seen, passed in ticks:
        now += passed
        state = machine.step(machine.event(seen, now), now)
        history.append(state)
        if state is ArmState.ACTIVE:
            assert seen.followable
            assert seen.grip is not Grip.RELEASED
            assert not seen.fault
            assert not seen.revoked
            assert pressed  # since the arm was last disarmed
        if seen.fault:
            assert state is ArmState.FAULT
        if state is ArmState.HOLD:
            hold_began = now if history[-2] is not ArmState.HOLD else hold_began
            assert now - hold_began <= 0.5
        if history[-2] is ArmState.FAULT and state is not ArmState.FAULT:
            assert seen.clear
            assert state is ArmState.DISARMED
        pressed = state not in (ArmState.DISARMED, ArmState.FAULT) and (pressed or seen.grip is Grip.PRESSED)


def test_the_page_shows_the_table() -> None:
    page = Path(__file__).parents[2] / "docs" / "ik_client.md"
    assert TABLE in page.read_text(encoding="utf-8")
