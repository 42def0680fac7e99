/** What the page remembers from visit to visit. Where the browser keeps nothing, defaults serve. */

const VIEW_MODE = "ik-xr.view-mode";

/** Ways to see the robot's picture: on a screen that stands in the room, or locked to the head. */
export const VIEW_MODES = ["screen", "head"];

/** @returns {string} One of `VIEW_MODES`. */
export function viewMode() {
  try {
    const kept = localStorage.getItem(VIEW_MODE);
    return VIEW_MODES.includes(kept) ? kept : VIEW_MODES[0];
  } catch {
    return VIEW_MODES[0];
  }
}

/** @param {string} mode One of `VIEW_MODES`. */
export function keepViewMode(mode) {
  try {
    localStorage.setItem(VIEW_MODE, mode);
  } catch {
    // Private browsing keeps nothing.
  }
}
