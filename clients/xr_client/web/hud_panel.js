/** The panel below the picture: a card for each arm, a note, and latencies. */

import { TextCanvas } from "./text_canvas.js";
import { CSS } from "./tones.js";

export const WIDTH = 1536;
const HEIGHT = 304;
const CARD = { width: 758, height: 176 };
const PADDING = 30;
/** Height of letters: the least is a degree to the eye, see `Placement` [px]. */
export const TEXT = 34;
const STATE = 50;
const BACKGROUND = "rgb(20 25 33 / 92%)";

/** Draws a `HudText`. */
export class HudPanel {
  /**
   * Make it, empty.
   * @param {WebGL2RenderingContext} gl The context.
   */
  constructor(gl) {
    this._surface = new TextCanvas(gl, WIDTH, HEIGHT);
  }

  /** What to draw the panel with. */
  get texture() {
    return this._surface.texture;
  }

  /**
   * Draw it, if it would look different.
   * @param {import("./hud_text.js").HudText} text The words.
   */
  write(text) {
    this._surface.update(text, () => {
      this._card(text.arms[0], 0);
      this._card(text.arms[1], WIDTH - CARD.width);
      this._rest(text);
    });
  }

  _card(arm, x) {
    const inner = CARD.width - 2 * PADDING - 14;
    const left = x + PADDING + 14;
    this._surface.box(x, 0, CARD.width, CARD.height, BACKGROUND);
    this._surface.box(x + 16, 20, 12, CARD.height - 40, CSS[arm.tone], 6);
    const small = { x: left, size: TEXT, width: inner };
    this._surface.line(arm.name, { ...small, y: 60, tone: "quiet" });
    this._surface.line(arm.state, { x: left + 190, y: 62, size: STATE, tone: arm.tone, width: 300, weight: 600 });
    this._surface.line(arm.figure, { ...small, x: left + inner, y: 60, tone: "plain", align: "right" });
    this._surface.lines(arm.detail.text, { ...small, y: 114, tone: arm.detail.tone, lines: 2 });
  }

  _rest({ note, footer }) {
    const y = CARD.height + 12;
    const width = WIDTH - 2 * PADDING;
    this._surface.box(0, y, WIDTH, HEIGHT - y, BACKGROUND);
    this._surface.line(note.text, { x: PADDING, y: y + 46, size: TEXT, tone: note.tone, width });
    this._surface.line(footer, { x: PADDING, y: y + 96, size: TEXT, tone: "quiet", width });
  }
}
