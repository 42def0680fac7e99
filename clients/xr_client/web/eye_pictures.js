/** The robot's latest picture, one image per eye: what waits to be drawn, what was, and how old it is. */

import { Texture } from "./gl.js";

/** A screen that has shown nothing yet: dark, but not the void. Red to opacity, 0 to 255. */
const DARK = [27, 32, 41, 255];
/** Width by height until an image says otherwise. */
const DEFAULT_ASPECT = 4 / 3;

/** Keeps an image that waits and, once `build` has made them, a texture per eye. */
export class EyePictures {
  constructor() {
    /** Width by height, and vertical field of view [degrees] (0: not known), of the image that is drawn. */
    this.aspect = DEFAULT_ASPECT;
    this.fovDeg = 0;
    /** Whether there is one. */
    this.drawn = false;
    this._waiting = null;
    this._came = null;
  }

  /**
   * Make the textures, dark. An image that waits is kept: it goes on when it can, and only then is it acknowledged.
   * @param {WebGL2RenderingContext} gl The context.
   */
  build(gl) {
    this._left = new Texture(gl, { rgba: DARK });
    this._right = new Texture(gl, { rgba: DARK });
    this.drawn = false;
  }

  /**
   * Take an image, in the place of one that was not drawn yet.
   * @param {{seq: number, fovDeg: number, left: ImageBitmap, right: ImageBitmap}} frame The image.
   * @param {number} now When it came [ms].
   */
  show(frame, now) {
    this._close();
    this._waiting = frame;
    this._came = now;
  }

  /**
   * Put the image that waits onto the graphics card.
   * @returns {number|null} Its number; null where none waits.
   */
  upload() {
    const frame = this._waiting;
    if (frame === null) {
      return null;
    }
    this.aspect = frame.left.width / frame.left.height;
    this.fovDeg = frame.fovDeg;
    this._left.upload(frame.left);
    this._right.upload(frame.right);
    this.drawn = true;
    this._close();
    return frame.seq;
  }

  /**
   * How long ago the latest image came.
   * @param {number} now Time [ms].
   * @returns {number|null} Its age [ms]; null before the first.
   */
  age(now) {
    return this._came === null ? null : now - this._came;
  }

  /**
   * What an eye sees.
   * @param {"left"|"right"|"none"} eye The eye.
   * @returns {Texture} Its texture.
   */
  texture(eye) {
    return eye === "right" ? this._right : this._left;
  }

  _close() {
    this._waiting?.left.close();
    this._waiting?.right.close();
    this._waiting = null;
  }
}
