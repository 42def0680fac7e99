/** What the headset's picture is drawn with: one canvas, its WebGL context and the stage, made at the first session. */

import { Stage } from "./stage.js";

export class Graphics {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {() => void} onLost Called when the graphics card has taken its context back.
   */
  constructor(canvas, onLost) {
    /** @type {Stage|null} */
    this.stage = null;
    this._canvas = canvas;
    this._gl = null;
    canvas.addEventListener("webglcontextlost", onLost);
  }

  /**
   * Get ready to draw. Made this late so that the context fits the headset that is there.
   *
   * @returns {WebGL2RenderingContext}
   * @throws {Error} There are no graphics, in words.
   */
  open() {
    if (this.stage === null) {
      this._gl = this._canvas.getContext("webgl2", { xrCompatible: true, antialias: false });
      if (this._gl === null) {
        throw new Error("the browser has no graphics left for this page");
      }
      this.stage = new Stage(this._gl);
    }
    if (this.stage.lost) {
      throw new Error("the headset has not given the graphics back yet");
    }
    return this._gl;
  }
}
