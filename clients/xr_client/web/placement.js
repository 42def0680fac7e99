/**
 * Where screen, notice and panel stand in the room.
 *
 * Screen: flat, 2 m ahead, as large as the robot's camera saw it, so that a degree in the picture is one to the eye.
 * Panel: just below it and nearer, tilted to the viewer. All of it is placed level around the head, once, and then
 * stands still while the head turns. In mode "head" it goes with the head, and the panel covers the picture's lower
 * part, as nobody can look down to it.
 */

import { facing, fromPose, level, multiply } from "./matrix.js";

const DEGREE = Math.PI / 180;
/** Of the screen and of what is written on it, and of the panel [m]. */
const SCREEN_DISTANCE = 2;
const NOTICE_DISTANCE = 1.95;
export const PANEL_DISTANCE = 1.5;
/** Width of the panel and of the notice [m]; height as a part of it. */
export const PANEL_WIDTH = 1.8;
export const PANEL_ASPECT = 1536 / 304;
const NOTICE_WIDTH = 1.5;
export const NOTICE_ASPECT = 1024 / 192;
/** Between screen and panel, and where the panel's middle is in mode "head" [rad]. */
const GAP = 1 * DEGREE;
const HEAD_ELEVATION = -24 * DEGREE;
/** Vertical field of view of a camera that does not say, and the widest that a flat screen shows [degrees]. */
export const DEFAULT_FOV = 75;
const WIDEST_FOV = 120;
/** Where a head is that nobody has seen yet. */
const STANDING = { position: [0, 1.6, 0], orientation: [0, 0, 0, 1] };

/** Keeps the places, as matrices for a square of half-width 1. */
export class Placement {
  constructor() {
    /** Room from square, 4x4, column-major. */
    this.screen = new Float32Array(16);
    this.notice = new Float32Array(16);
    this.panel = new Float32Array(16);
    this._due = true;
    this._anchor = new Float32Array(16);
    this._local = new Float32Array(16);
    fromPose(this._anchor, STANDING.position, STANDING.orientation);
  }

  /** Place all anew, at the next head that is seen. */
  recenter() {
    this._due = true;
  }

  /**
   * Follow the head as far as the mode asks for it.
   * @param {{position: number[], orientation: number[]}|null} head Where it is; null keeps things where they are.
   * @param {"screen"|"head"} mode See `Stage.mode`.
   * @param {number} aspect Width of the picture by its height.
   * @param {number} fovDeg The camera's vertical field of view [degrees]; 0 where it is not known.
   */
  update(head, mode, aspect, fovDeg) {
    const locked = mode === "head";
    if (head !== null && (this._due || locked)) {
      fromPose(this._anchor, head.position, head.orientation);
      // After a time on the head the screen must be placed in the room again.
      this._due = locked;
      if (!locked) {
        level(this._anchor);
      }
    }
    const halfFov = 0.5 * DEGREE * Math.min(fovDeg > 0 ? fovDeg : DEFAULT_FOV, WIDEST_FOV);
    const halfHeight = SCREEN_DISTANCE * Math.tan(halfFov);
    this._place(this.screen, 0, SCREEN_DISTANCE, aspect * halfHeight, halfHeight);
    this._place(this.notice, 0, NOTICE_DISTANCE, 0.5 * NOTICE_WIDTH, (0.5 * NOTICE_WIDTH) / NOTICE_ASPECT);
    const halfPanel = (0.5 * PANEL_WIDTH) / PANEL_ASPECT;
    const below = -(halfFov + GAP + Math.atan(halfPanel / PANEL_DISTANCE));
    const elevation = locked ? Math.max(below, HEAD_ELEVATION) : below;
    this._place(this.panel, elevation, PANEL_DISTANCE, 0.5 * PANEL_WIDTH, halfPanel);
  }

  /** Place a rectangle around the anchor. */
  _place(out, elevation, distance, halfWidth, halfHeight) {
    facing(this._local, elevation, distance, halfWidth, halfHeight);
    multiply(out, this._anchor, this._local);
  }
}
