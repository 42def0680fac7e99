/** What failed, in words: the browser's own names for its errors say nothing to a person. */

const WORDS = {
  NotAllowedError:
    "the browser did not allow it. Press the button again, and say yes when the headset asks; if it does not ask, " +
    "allow virtual reality and hand tracking for this page in the browser's settings.",
  NotSupportedError:
    "the headset does not offer this mode with a floor to stand on. Set the headset's floor and boundary up, or use " +
    "the other button.",
  SecurityError:
    "the browser accepts this only from a press of the button on a page it trusts. Press the button again; if that " +
    "does not help, open the address that ik-xr printed.",
  AbortError: "the headset ended the session at once. Press the button again.",
  InvalidStateError: "another virtual reality session is running. Leave it, then press the button again.",
};

/**
 * Say why the headset could not be entered.
 *
 * @param {Error} error
 * @returns {string} A sentence with what to do.
 */
export function whyNotEntered(error) {
  const words = WORDS[error.name] ?? `${error.message || error.name}. Reload this page and try again.`;
  return `Could not enter: ${words}`;
}

/**
 * Hear of every error that nobody has caught.
 *
 * @param {(words: string) => void} show
 */
export function watchForErrors(show) {
  addEventListener("error", ({ message }) => show(`Something went wrong in this page: ${message}. Reload it.`));
  addEventListener("unhandledrejection", ({ reason }) => {
    show(`Something went wrong in this page: ${reason?.message ?? reason}. Reload it.`);
  });
}
