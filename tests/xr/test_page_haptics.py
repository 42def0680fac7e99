"""What an operator feels: pulses of controllers that only count them."""

from typing import Any

import pytest
from picture_rig import Rig, arm, hud

pytest_plugins = ["picture_fixtures"]

FEEL = """([steps, kind]) => {
  const felt = [];
  const waiting = [];
  const later = globalThis.setTimeout;
  globalThis.setTimeout = (work, ms, ...rest) => waiting.push(() => work(...rest));
  const source = (handedness) => {
    const pulse = (strength, ms) => { felt.push([handedness, strength]); return Promise.reject(new Error("busy")); };
    const playEffect = (name, { weakMagnitude }) => pulse(weakMagnitude, 0);
    const haptic = { hapticActuators: [{ pulse }] };
    const gamepad = { haptic, vibration: { vibrationActuator: { playEffect } }, none: {}, absent: null, hand: haptic };
    return { handedness, gamepad: gamepad[kind], hand: kind === "hand" ? {} : null };
  };
  const sources = ["left", "right", "none"].map(source);
  let before = null;
  for (const [now, hud] of steps) {
    rig.modules.buzz(sources, before, hud, now);
    before = hud;
  }
  waiting.forEach((work) => work());
  globalThis.setTimeout = later;
  return felt;
}"""


def feel(rig: Rig, *steps: tuple[float, Any], kind: str = "haptic") -> list[tuple[str, float]]:
    """Side and strength of every pulse, when HUDs come at their times [ms]."""
    return rig.js(FEEL, [[list(step) for step in steps], kind])


@pytest.mark.parametrize(
    ("state", "pulses"), [("active", 1), ("hold", 2), ("fault", 2), ("disarmed", 0), ("aligning", 0)]
)
@pytest.mark.parametrize("kind", ["haptic", "vibration"])
def test_controllers_pulse_when_an_arm_begins_and_stops(used_rig, state, pulses, kind):
    before = hud(arm("aligning", changes=1), arm("aligning", changes=3))
    after = hud(arm("aligning", changes=1), arm(state, changes=4))
    felt = feel(used_rig, (0, before), (50, after), (100, after), kind=kind)
    assert [side for side, _ in felt] == ["right"] * pulses


def test_a_warning_is_felt_weakly_twice_a_second(used_rig):
    begins = hud(arm(changes=1), arm())
    warned = hud(arm(changes=1, warning="8 cm away from the hand"), arm())
    felt = feel(used_rig, (0, hud()), (50, begins), *((100 + 50 * i, warned) for i in range(40)))
    strengths = [strength for side, strength in felt if side == "left"]
    assert len(strengths) == len(felt) == 1 + 4
    assert max(strengths[1:]) < strengths[0]


@pytest.mark.parametrize("kind", ["none", "absent", "hand"])
def test_what_cannot_be_felt_is_no_error(used_rig, kind):
    assert feel(used_rig, (0, hud()), (50, hud(arm("hold", changes=1))), kind=kind) == []


def test_nothing_pulses_at_the_first_word_or_when_the_server_begins_anew(used_rig):
    assert feel(used_rig, (0, hud(arm(changes=5))), (50, hud(arm(changes=0)))) == []
