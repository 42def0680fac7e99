/**
 * What an operator feels of the arms' states: pulses of the controllers. Hands feel nothing.
 *
 * | when                              | pulse                |
 * |-----------------------------------|----------------------|
 * | an arm begins to follow           | one, short           |
 * | it holds, or is in fault          | two                  |
 * | it warns, for as long as it does  | weak, twice a second |
 */

const BEGINS = { strength: 0.6, ms: 60 };
const STOPS = { strength: 0.9, ms: 90 };
const WARNS = { strength: 0.25, ms: 30 };
/** From the beginning of a pulse to the next of the two, and of one warning to the next [ms]. */
const AGAIN = 180;
const WARNING_PERIOD = 500;

/** When each side was last warned [ms]. */
const warned = { left: -Infinity, right: -Infinity };

/**
 * Let the controllers say what has changed.
 * @param {Iterable<XRInputSource>} inputSources Those of the session.
 * @param {object|null} before The `hud` message before; null at the beginning.
 * @param {object} after The `hud` message now.
 * @param {number} now Time [ms].
 */
export function buzz(inputSources, before, after, now = performance.now()) {
  for (const source of inputSources) {
    const side = source.handedness;
    const arm = after[side];
    if (!source.gamepad || source.hand || !arm) {
      continue;
    }
    const changed = before !== null && arm.changes > before[side].changes;
    if (changed && arm.state === "active") {
      pulse(source.gamepad, BEGINS);
    } else if (changed && (arm.state === "hold" || arm.state === "fault")) {
      pulse(source.gamepad, STOPS);
      setTimeout(pulse, AGAIN, source.gamepad, STOPS);
    } else if (arm.warning && now - warned[side] >= WARNING_PERIOD) {
      warned[side] = now;
      pulse(source.gamepad, WARNS);
    }
  }
}

/** Pulse in whichever way the browser has; one that refuses is as good as none. */
function pulse(gamepad, { strength, ms }) {
  const actuator = gamepad.hapticActuators?.[0] ?? gamepad.vibrationActuator;
  const done = actuator?.pulse
    ? actuator.pulse(strength, ms)
    : actuator?.playEffect?.("dual-rumble", { duration: ms, strongMagnitude: strength, weakMagnitude: strength });
  done?.catch?.(() => {});
}
