/**
 * What is drawn in VR: the robot's picture on a screen, what the service says below it, hands as points.
 *
 * - The left eye gets the left image and the right eye the right one; everything else stands at one place for both.
 * - Newest wins: an image that was not drawn yet is closed when the next one comes.
 * - `hud` may be called as often as one likes; states and notes are drawn when they change, numbers at most twice a second.
 * - A lost WebGL context is no error: nothing is drawn until the browser restores it, then everything is built anew.
 */

import { EyePictures } from "./eye_pictures.js";
import { PointCloud } from "./gl_points.js";
import { Quads } from "./gl_quads.js";
import { HudPanel } from "./hud_panel.js";
import { OLD, hudText, pictureNotice } from "./hud_text.js";
import { multiply } from "./matrix.js";
import { NoticePanel } from "./notice_panel.js";
import { Placement } from "./placement.js";
import { RGB } from "./tones.js";

/** How often text may change [ms]. */
const TEXT_PERIOD = 500;
/** The void around the screen, red to blue. */
const VOID = [0.03, 0.035, 0.045];
/** How bright a picture is while it counts, and when it is too old. */
const BRIGHT = 1;
const DIMMED = 0.35;
/** Diameter of the point of a hand's joint, and of a controller [m]. */
const JOINT = 0.009;
const GRIP = 0.035;

/**
 * @typedef {object} View One eye of a frame.
 * @property {"left"|"right"|"none"} eye "none" sees the left image.
 * @property {Float32Array} projection Clip space from eye, 4x4, column-major.
 * @property {Float32Array} view Eye from room, 4x4, column-major: the inverse of the view's transform.
 * @property {{x: number, y: number, width: number, height: number}} viewport Part of the framebuffer [px].
 */

/**
 * @typedef {object} Points Where hands are.
 * @property {Float32Array} xyz Three numbers a point, in the room [m]: those of the left arm first, then the right's.
 * @property {number} left How many belong to the left arm. One alone is a controller's grip and is drawn larger.
 * @property {number} right How many belong to the right arm.
 */

/** Draws a session's frames. */
export class Stage {
  /**
   * Build what is drawn with; `recenter` places it.
   * @param {WebGL2RenderingContext} gl Of the canvas that the session's layer was made for.
   * @param {() => number} clock Monotonic time [ms].
   */
  constructor(gl, clock = () => performance.now()) {
    /** @type {"screen"|"head"} Whether the screen stands in the room or goes with the head. */
    this.mode = "screen";
    this._gl = gl;
    this._clock = clock;
    this._placement = new Placement();
    this._pictures = new EyePictures();
    this._state = { hud: null, link: null, video: null };
    this._tones = ["idle", "idle"];
    this._textDue = -Infinity;
    this._said = "";
    this._old = true;
    this._clip = new Float32Array(16);
    this._build();
    gl.canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault(); // else the browser never restores it
      this._built = false;
    });
    gl.canvas.addEventListener("webglcontextrestored", () => this._build());
  }

  /** Whether nothing can be drawn now, as the graphics card took its context back. */
  get lost() {
    return !this._built || this._gl.isContextLost();
  }

  /**
   * Show an image from the next frame on.
   * @param {{seq: number, takenMs: number, fovDeg: number, left: ImageBitmap, right: ImageBitmap}} frame The images;
   *   they are closed here.
   */
  show(frame) {
    this._pictures.show(frame, this._clock());
  }

  /**
   * Say how things are.
   * @param {import("./hud_text.js").HudState} state May be the same object as before, with other values in it.
   */
  hud(state) {
    this._state = state;
    const { left, right, note } = state.hud ?? {};
    const said = [left?.state, left?.reason, right?.state, right?.reason, note, state.link?.open].join("\n");
    if (said !== this._said) {
      this._said = said;
      this._textDue = -Infinity;
    }
  }

  /** Place the screen anew: where the head looks in the next frame. */
  recenter() {
    this._placement.recenter();
  }

  /**
   * Draw a frame.
   * @param {WebGLFramebuffer|null} framebuffer Where to.
   * @param {View[]} views The eyes.
   * @param {{position: number[], orientation: number[]}|null} head The head in the room [m], quaternion xyzw; null
   *   where it is not known.
   * @param {Points|null} points The hands; null without any.
   * @param {boolean} passthrough Leave the surroundings transparent, so that the room is seen.
   * @returns {number|null} Number of the image that was drawn for the first time; null where none was.
   */
  draw(framebuffer, views, head, points, passthrough) {
    if (this.lost) {
      return null;
    }
    const gl = this._gl;
    const now = this._clock();
    const seq = this._pictures.upload();
    const age = this._pictures.age(now);
    const old = age === null || age > OLD;
    if (now >= this._textDue || old !== this._old) {
      this._textDue = now + TEXT_PERIOD;
      this._old = old;
      this._write(age);
    }
    this._placement.update(head, this.mode, this._pictures.aspect, this._pictures.fovDeg);
    this._points.place(points);

    const opacity = passthrough ? 0 : 1;
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.clearColor(VOID[0] * opacity, VOID[1] * opacity, VOID[2] * opacity, opacity);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.DEPTH_TEST); // drawn from far to near
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA); // colours are multiplied by their opacity already
    for (let i = 0; i < views.length; i++) {
      this._drawEye(views[i], points);
    }
    gl.bindVertexArray(null);
    return seq;
  }

  _drawEye(view, points) {
    const { x, y, width, height } = view.viewport;
    const picture = this._pictures.texture(view.eye);
    const noticed = this._notice.shown;
    const brightness = noticed && this._pictures.drawn ? DIMMED : BRIGHT;
    this._gl.viewport(x, y, width, height);
    multiply(this._clip, view.projection, view.view);
    this._quads.begin(this._clip);
    this._quads.draw(this._placement.screen, picture, brightness);
    if (noticed) {
      this._quads.draw(this._placement.notice, this._notice.texture, BRIGHT);
    }
    this._quads.draw(this._placement.panel, this._panel.texture, BRIGHT);
    if (points !== null) {
      const { left, right } = points;
      this._points.begin(this._clip, 0.5 * height * view.projection[5]);
      this._points.draw(0, left, left === 1 ? GRIP : JOINT, RGB[this._tones[0]]);
      this._points.draw(left, right, right === 1 ? GRIP : JOINT, RGB[this._tones[1]]);
    }
  }

  /** Make all that lives on the graphics card. */
  _build() {
    const gl = this._gl;
    this._built = !gl.isContextLost();
    if (this._built) {
      this._pictures.build(gl);
      this._quads = new Quads(gl);
      this._points = new PointCloud(gl);
      this._panel = new HudPanel(gl);
      this._notice = new NoticePanel(gl);
      this._textDue = -Infinity;
    }
  }

  /** Draw the texts that have changed. */
  _write(age) {
    const text = hudText(this._state);
    this._tones[0] = text.arms[0].tone;
    this._tones[1] = text.arms[1].tone;
    this._panel.write(text);
    this._notice.write(pictureNotice(this._state, age));
  }
}
