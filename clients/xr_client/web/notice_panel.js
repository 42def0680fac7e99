/** What stands in the middle of the screen where the picture is missing or old. */

import { TextCanvas } from "./text_canvas.js";

const WIDTH = 1024;
const HEIGHT = 192;
const TITLE = 60;
const TEXT = 38;

/** Draws a notice of a title and an explanation. */
export class NoticePanel {
  /**
   * Make it, empty.
   * @param {WebGL2RenderingContext} gl The context.
   */
  constructor(gl) {
    this._surface = new TextCanvas(gl, WIDTH, HEIGHT);
    this.shown = false;
  }

  /** What to draw the notice with. */
  get texture() {
    return this._surface.texture;
  }

  /**
   * Draw it, if it would look different.
   * @param {string[]} words Title and explanation; empty for no notice: `shown` says so.
   */
  write(words) {
    this.shown = words.length > 0;
    if (this.shown) {
      const middle = { x: WIDTH / 2, width: WIDTH - 60, align: "center" };
      this._surface.update(words, () => {
        this._surface.box(0, 0, WIDTH, HEIGHT, "rgb(9 12 17 / 82%)", 28);
        this._surface.line(words[0], { ...middle, y: 74, size: TITLE, tone: "plain", weight: 600 });
        this._surface.lines(words[1], { ...middle, y: 124, size: TEXT, tone: "wait", lines: 2 });
      });
    }
  }
}
