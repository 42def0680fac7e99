/**
 * The panel that tells a person which keys there are, and what the hands are doing. It lies over the emulated headset's
 * view and lets every click through.
 */

import { HELP } from "./controls.js";
import { SIDES } from "./device.js";

export class Help {
  /**
   * Show it.
   *
   * @param {import("./operator.js").Operator} operator
   * @param {import("./controls.js").Controls} controls
   */
  constructor(operator, controls) {
    this._operator = operator;
    this._controls = controls;
    this._panel = element("aside", "");
    this._panel.id = "emulator-help";
    this._state = element("p", "");
    this._keys = element("dl", "");
    for (const [what, follows] of HELP) {
      this._keys.append(element("dt", what), element("dd", follows));
    }
    this._panel.append(element("h2", "emulated headset"), this._state, this._keys);
    document.body.append(this._panel);
  }

  /** Say how things are; called once per frame. */
  update() {
    const inside = Boolean(this._operator.device.activeSession);
    this._panel.classList.toggle("inside", inside);
    this._keys.hidden = !(inside && this._controls.helpShown);
    const said = inside ? this._inside() : "Enter VR; then mouse and keys move your hands.";
    if (said !== this._state.textContent) {
      this._state.textContent = said;
    }
  }

  _inside() {
    const { chosen } = this._controls;
    const { mode, gripping } = this._operator;
    const which = chosen.length === 2 ? `both ${mode}s` : `${chosen[0]} ${mode}`;
    const lost = SIDES.filter((side) => !this._operator.sees(side));
    const parts = [`moving: ${which}`];
    if (SIDES.some((side) => gripping[side])) {
      parts.push("gripping");
    }
    if (lost.length > 0) {
      parts.push(`out of sight: ${lost.join(", ")}`);
    }
    if (this._operator.device.visibilityState !== "visible") {
      parts.push("a menu is open");
    }
    return parts.join(" · ");
  }
}

function element(kind, text) {
  const made = document.createElement(kind);
  made.textContent = text;
  return made;
}
