/**
 * Mouse and keys move the operator. They act only while a session runs; before it the page has them for itself.
 *
 * What is held acts as long as it is held: a grip too. All is let go when the window loses the keyboard.
 */

import { SIDES } from "./device.js";

/** How far a hand goes for a pixel of the mouse, and for a unit of its wheel [m]. */
const DRAG = 1e-3;
const WHEEL = 5e-4;
/** How far a hand and the head turn for a pixel [rad]. */
const TURN = 6e-3;
const LOOK = 3e-3;
/** How fast a hand and the operator go while a key is held [m/s]. */
const HAND_SPEED = 0.25;
const WALKING_SPEED = 0.6;
/** Longest time between two frames that held keys act for [s]: after a pause nothing leaps. */
const LONGEST = 0.05;

const HAND_KEYS = {
  ArrowRight: [1, 0, 0],
  ArrowLeft: [-1, 0, 0],
  ArrowUp: [0, 1, 0],
  ArrowDown: [0, -1, 0],
  PageUp: [0, 0, -1],
  PageDown: [0, 0, 1],
};
const WALKING_KEYS = { KeyD: [1, 0, 0], KeyA: [-1, 0, 0], KeyS: [0, 0, 1], KeyW: [0, 0, -1] };
const CHOICES = { Digit1: ["left"], Digit2: ["right"], Digit3: SIDES };

const ACTIONS = ["Space", "KeyH", "KeyL", "KeyR", "KeyM", "Slash", "Escape"];

/** What a person is told, a line each: what to do, and what follows. */
export const HELP = [
  ["drag, wheel", "move the hand; away and near"],
  ["shift + drag", "turn the hand"],
  ["right drag", "look around"],
  ["space, held", "grip"],
  ["1 2 3", "left hand, right hand, both"],
  ["arrows, page up/down", "move the hand"],
  ["W A S D", "walk"],
  ["H", "hands or controllers"],
  ["L", "hide the hand, show it"],
  ["R", "recenter"],
  ["M", "open a menu before the page, close it"],
  ["?", "hide these lines, show them"],
  ["escape", "leave VR"],
];

export class Controls {
  /**
   * Listen.
   *
   * @param {import("./operator.js").Operator} operator
   */
  constructor(operator) {
    this.chosen = SIDES;
    this.helpShown = true;
    this._operator = operator;
    this._device = operator.device;
    this._held = new Set();
    this._last = null;
    const view = this._device.canvasContainer;
    view.addEventListener("pointerdown", (event) => view.setPointerCapture(event.pointerId));
    view.addEventListener("pointermove", (event) => this._drag(event));
    view.addEventListener("wheel", (event) => this._roll(event), { passive: false });
    view.addEventListener("contextmenu", (event) => event.preventDefault());
    // Before the page's own listeners, and before a focused button takes the space bar for itself.
    addEventListener("keydown", (event) => this._press(event), { capture: true });
    addEventListener("keyup", (event) => this._release(event), { capture: true });
    addEventListener("blur", () => this._letGo());
  }

  /** Let held keys act; called once per frame with the time [ms]. */
  step(now) {
    const time = this._last === null ? 0 : Math.min((now - this._last) / 1e3, LONGEST);
    this._last = now;
    if (this._held.size > 0 && !this._device.activeSession) {
      this._letGo();
    }
    for (const code of this._held) {
      if (code in HAND_KEYS) {
        this._moveHands(HAND_KEYS[code].map((x) => x * HAND_SPEED * time));
      } else if (code in WALKING_KEYS) {
        this._operator.walk(WALKING_KEYS[code].map((x) => x * WALKING_SPEED * time));
      }
    }
  }

  _press(event) {
    if (!this._takes(event)) {
      return;
    }
    event.preventDefault();
    event.stopImmediatePropagation();
    if (!event.repeat) {
      this._held.add(event.code);
      this._act(event.code);
    }
  }

  _act(code) {
    const operator = this._operator;
    if (code in CHOICES) {
      this._grip(false);
      this.chosen = CHOICES[code];
    } else if (code === "Space") {
      this._grip(true);
    } else if (code === "KeyH") {
      operator.swapControllers();
    } else if (code === "KeyL") {
      const seen = !this.chosen.every((side) => operator.sees(side));
      this.chosen.forEach((side) => operator.setSeen(side, seen));
    } else if (code === "KeyR") {
      operator.recenter();
    } else if (code === "KeyM") {
      const menu = this._device.visibilityState === "visible";
      this._device.updateVisibilityState(menu ? "visible-blurred" : "visible");
    } else if (code === "Slash") {
      this.helpShown = !this.helpShown;
    } else if (code === "Escape") {
      this._device.activeSession.end();
    }
  }

  _release(event) {
    if (!this._held.delete(event.code)) {
      return;
    }
    event.preventDefault();
    event.stopImmediatePropagation();
    if (event.code === "Space") {
      this._grip(false);
    }
  }

  _letGo() {
    this._held.clear();
    SIDES.forEach((side) => this._operator.grip(side, false));
  }

  _grip(held) {
    this.chosen.forEach((side) => this._operator.grip(side, held));
  }

  _drag(event) {
    const { buttons, movementX: x, movementY: y } = event;
    if (buttons & 2) {
      this._operator.look(-x * LOOK, -y * LOOK);
    } else if (buttons & 1 && event.shiftKey) {
      for (const side of this.chosen) {
        this._operator.turn(side, [0, 1, 0], x * TURN);
        this._operator.turn(side, [1, 0, 0], y * TURN);
      }
    } else if (buttons & 1) {
      this._moveHands([x * DRAG, -y * DRAG, 0]);
    }
  }

  _roll(event) {
    event.preventDefault();
    this._moveHands([0, 0, event.deltaY * WHEEL]);
  }

  _moveHands(step) {
    this.chosen.forEach((side) => this._operator.move(side, step));
  }

  _takes(event) {
    const moves = event.code in HAND_KEYS || event.code in WALKING_KEYS || event.code in CHOICES;
    const ours = moves || ACTIONS.includes(event.code);
    return ours && Boolean(this._device.activeSession) && !(event.ctrlKey || event.altKey || event.metaKey);
  }
}
