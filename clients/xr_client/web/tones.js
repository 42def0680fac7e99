/** Colours by what they mean, the same for text and for points. */

/** Red to blue, 0 to 1. */
export const RGB = {
  idle: [0.62, 0.66, 0.71],
  wait: [1.0, 0.71, 0.2],
  good: [0.3, 0.85, 0.47],
  bad: [1.0, 0.36, 0.34],
  plain: [0.93, 0.95, 0.97],
  quiet: [0.56, 0.61, 0.67],
};

/** As CSS has them. */
export const CSS = Object.fromEntries(
  Object.entries(RGB).map(([tone, rgb]) => [tone, `rgb(${rgb.map((part) => Math.round(255 * part)).join(" ")})`]),
);

/** Of an arm's state. */
export const OF_STATE = { disarmed: "idle", aligning: "wait", active: "good", hold: "wait", fault: "bad" };
