/**
 * The person who wears the emulated headset: moves head and hands, grips, loses a hand out of sight.
 *
 * Hands tremble by two micrometres, as no hand stands still to the bit; a pose that does is taken for a frozen one. The
 * device may be moved from elsewhere at the same time: what it was set to is then where it trembles about.
 */

import { HEAD, SIDES, trackedPoint } from "./device.js";
import { about, add, between, compose, inverse, multiply, rotate, unit } from "./rotation.js";

/** How far hands tremble along each axis [m]. */
const TREMBLE = 2e-6;
/** How far one can look up and down: sine of the angle. */
const STEEPEST = 0.95;
const UP = [0, 1, 0];

/** Where hands are at first, seen from the head: raised before the chest, fingers ahead [m]. */
const REACH = { left: [-0.2, -0.35, -0.4], right: [0.2, -0.35, -0.4] };

export class Operator {
  /**
   * Raise the hands.
   *
   * @param {object} device An `IWER.XRDevice`.
   * @param {object} iwer The global object of IWER's script.
   */
  constructor(device, iwer) {
    this.device = device;
    this.gripping = { left: false, right: false };
    this._inputs = [];
    for (const side of SIDES) {
      for (const input of [device.hands[side], device.controllers[side]]) {
        this._inputs.push({ input, tracked: trackedPoint(iwer, input), still: [0, 0, 0], shown: null });
      }
    }
    for (const side of SIDES) {
      this.place(side, add(HEAD, REACH[side]), [0, 0, 0, 1]);
    }
  }

  /** "hand" or "controller". */
  get mode() {
    return this.device.primaryInputMode;
  }

  /**
   * Put a hand somewhere in the room.
   *
   * @param {"left" | "right"} side
   * @param {number[]} position Of the wrist joint, or of the controller's grip [m].
   * @param {number[]} orientation Of the same, a unit quaternion xyzw.
   */
  place(side, position, orientation) {
    this._put(this._active(side), { position, orientation });
  }

  /** Where a hand is: what `place` would be told to leave it there. */
  pose(side) {
    const entry = this._active(side);
    return compose({ position: this._still(entry), orientation: orientationOf(entry.input) }, entry.tracked);
  }

  /** Move a hand by [right, up, back], as the operator sees it [m]. */
  move(side, step) {
    const { position, orientation } = this.pose(side);
    this.place(side, add(position, rotate(this._heading(), step)), orientation);
  }

  /** Turn a hand about its own place, around an axis [right, up, back] as the operator sees it, by an angle [rad]. */
  turn(side, axis, angle) {
    const { position, orientation } = this.pose(side);
    this.place(side, position, multiply(about(rotate(this._heading(), axis), angle), orientation));
  }

  /** Turn the head to the left and up [rad]. Hands stay where they are. */
  look(left, up) {
    const head = this.device.quaternion;
    const turned = multiply(about(UP, left), orientationOf(this.device));
    const raised = multiply(turned, about([1, 0, 0], up));
    head.set(...unit(Math.abs(rotate(raised, [0, 0, -1])[1]) < STEEPEST ? raised : turned));
  }

  /** Walk by [right, up, back] [m]; the hands come along. */
  walk(step) {
    const way = rotate(this._heading(), step);
    this.device.position.set(...add(positionOf(this.device), way));
    for (const entry of this._inputs) {
      entry.input.position.set(...add(this._still(entry), way));
    }
  }

  /** Pinch or squeeze, or let go. */
  grip(side, held) {
    this.gripping[side] = held;
    this.device.hands[side].updatePinchValue(held && this.mode === "hand" ? 1 : 0);
    this.device.controllers[side].updateButtonValue("squeeze", held && this.mode === "controller" ? 1 : 0);
  }

  /** Take up the controllers where the hands are, pointing where they point, or lay them down. Lets go. */
  swapControllers() {
    const before = SIDES.map((side) => this._active(side));
    this.device.primaryInputMode = this.mode === "hand" ? "controller" : "hand";
    SIDES.forEach((side, k) => {
      this.grip(side, false);
      const { input } = this._active(side);
      input.position.set(...this._still(before[k]));
      input.quaternion.copy(before[k].input.quaternion);
    });
  }

  /** Whether the headset sees a hand. */
  sees(side) {
    return this._active(side).input.connected;
  }

  /** Take a hand out of the headset's sight, or bring it back. */
  setSeen(side, seen) {
    this.device.hands[side].connected = seen;
    this.device.controllers[side].connected = seen;
  }

  /** Make where the operator stands and looks the room's middle and front. */
  recenter() {
    const back = inverse(this._heading());
    const [x, , z] = positionOf(this.device);
    const moved = [this.device, ...this._inputs.map((entry) => entry.input)].map((body) => ({
      body,
      position: rotate(back, add(positionOf(body), [-x, 0, -z])),
      orientation: multiply(back, orientationOf(body)),
    }));
    // It tells the page; but what it does to poses is right only for a level head that looks ahead.
    this.device.recenter();
    for (const { body, position, orientation } of moved) {
      body.position.set(...position);
      body.quaternion.set(...orientation);
    }
  }

  /** Let the hands tremble; called once per frame with the time [ms]. */
  tremble(now) {
    const offset = [0.031, 0.037, 0.041].map((rate) => TREMBLE * Math.sin(rate * now));
    for (const entry of this._inputs) {
      entry.still = this._still(entry);
      entry.input.position.set(...add(entry.still, offset));
      entry.shown = positionOf(entry.input);
    }
  }

  /** Where it would be without trembling: as it was, unless somebody has moved it since. */
  _still({ input, still, shown }) {
    const here = positionOf(input);
    return shown !== null && here.every((x, k) => x === shown[k]) ? still : here;
  }

  _put({ input, tracked }, pose) {
    const told = compose(pose, between(tracked, ORIGIN));
    input.position.set(...told.position);
    input.quaternion.set(...unit(told.orientation));
  }

  _active(side) {
    const input = (this.mode === "hand" ? this.device.hands : this.device.controllers)[side];
    return this._inputs.find((entry) => entry.input === input);
  }

  /** The turn about the vertical to where the head looks. */
  _heading() {
    const [x, , z] = rotate(orientationOf(this.device), [0, 0, -1]);
    return about(UP, Math.atan2(-x, -z));
  }
}

const ORIGIN = { position: [0, 0, 0], orientation: [0, 0, 0, 1] };

function positionOf({ position: { x, y, z } }) {
  return [x, y, z];
}

function orientationOf({ quaternion: { x, y, z, w } }) {
  return [x, y, z, w];
}
