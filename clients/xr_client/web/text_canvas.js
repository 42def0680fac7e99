/** A canvas for words that becomes a texture when they change. */

import { Texture } from "./gl.js";
import { CSS } from "./tones.js";

export const FAMILY = "system-ui, -apple-system, Roboto, 'DejaVu Sans', sans-serif";

/** Canvas and texture of one size. */
export class TextCanvas {
  /**
   * Make them, empty.
   * @param {WebGL2RenderingContext} gl The context.
   * @param {number} width Of the canvas [px].
   * @param {number} height Of the canvas [px].
   */
  constructor(gl, width, height) {
    this.texture = new Texture(gl, { mipmaps: true });
    this._canvas = document.createElement("canvas");
    this._canvas.width = width;
    this._canvas.height = height;
    this._paint = this._canvas.getContext("2d");
    this._key = "";
  }

  /**
   * Draw, if it would look different.
   * @param {*} words What shall stand there; data.
   * @param {() => void} draw Draws it on the empty canvas.
   */
  update(words, draw) {
    const key = JSON.stringify(words);
    if (key !== this._key) {
      this._key = key;
      this._paint.clearRect(0, 0, this._canvas.width, this._canvas.height);
      draw();
      this.texture.upload(this._canvas);
    }
  }

  /**
   * A filled rectangle with round corners.
   * @param {number} x Left [px].
   * @param {number} y Top [px].
   * @param {number} width Of it [px].
   * @param {number} height Of it [px].
   * @param {string} fill Colour.
   * @param {number} radius Of the corners [px].
   */
  box(x, y, width, height, fill, radius = 20) {
    this._paint.fillStyle = fill;
    this._paint.beginPath();
    this._paint.roundRect(x, y, width, height, radius);
    this._paint.fill();
  }

  /**
   * A line of text; what does not fit is cut.
   * @param {string} text The words.
   * @param {object} how Where its baseline is and how it looks.
   * @param {number} how.x Where it begins, ends or has its middle, by `align` [px].
   * @param {number} how.y Where it stands [px].
   * @param {number} how.size Of the font [px].
   * @param {string} how.tone See `tones.js`.
   * @param {number} how.width That it may have [px].
   * @param {CanvasTextAlign} [how.align] Left, right or center.
   * @param {number} [how.weight] Of the font.
   */
  line(text, { x, y, size, tone, width, align = "left", weight = 400 }) {
    this._paint.font = `${weight} ${size}px ${FAMILY}`;
    this._paint.textAlign = align;
    this._paint.fillStyle = CSS[tone];
    this._paint.fillText(cut(text, width, (part) => this._paint.measureText(part).width), x, y);
  }

  /**
   * Words in as many lines as they need, up to a limit.
   * @param {string} text The words.
   * @param {object} how As for `line`; `y` is that of the first, and `lines` is the limit.
   */
  lines(text, { lines, ...how }) {
    this._paint.font = `400 ${how.size}px ${FAMILY}`;
    const rows = wrap(text, how.width, lines, (part) => this._paint.measureText(part).width);
    rows.forEach((row, i) => this.line(row, { ...how, y: how.y + i * 1.2 * how.size }));
  }
}

/**
 * Break words into lines.
 * @param {string} text The words.
 * @param {number} width That a line may have.
 * @param {number} limit How many lines there may be; the last one takes what is left, however long.
 * @param {(text: string) => number} measure Width of a text.
 * @returns {string[]} The lines.
 */
export function wrap(text, width, limit, measure) {
  const rows = [];
  for (const word of text.split(" ").filter(Boolean)) {
    const row = rows.length > 0 ? `${rows.at(-1)} ${word}` : word;
    if (rows.length > 0 && (measure(row) <= width || rows.length === limit)) {
      rows[rows.length - 1] = row;
    } else {
      rows.push(word);
    }
  }
  return rows;
}

/**
 * As much of a line as fits.
 * @param {string} text The line.
 * @param {number} width That it may have.
 * @param {(text: string) => number} measure Width of a text.
 * @returns {string} The line; where it was cut it ends with an ellipsis.
 */
export function cut(text, width, measure) {
  if (measure(text) <= width) {
    return text;
  }
  let end = text.length;
  while (end > 0 && measure(`${text.slice(0, end)}…`) > width) {
    end -= 1;
  }
  return `${text.slice(0, end).trimEnd()}…`;
}
