// The page's drawing without a headset: a canvas with an eye on each half, a clock that tests set, pixels to read.
import * as hudText from "./hud_text.js";
import { buzz } from "./haptics.js";
import { Stage } from "./stage.js";
import * as textCanvas from "./text_canvas.js";
import { VideoLink } from "./video_link.js";

const WIDTH = 640;
const HEIGHT = 320;

class Rig {
  constructor() {
    this.canvas = document.createElement("canvas");
    this.canvas.width = WIDTH;
    this.canvas.height = HEIGHT;
    document.body.append(this.canvas);
    this.gl = this.canvas.getContext("webgl2", { antialias: false, alpha: true, preserveDrawingBuffer: true });
    this.now = 0;
    this.stage = new Stage(this.gl, () => this.now);
    this.head = null;
    this.views = [];
    this.points = null;
    this.passthrough = false;
    this.modules = { ...hudText, ...textCanvas, buzz };
  }

  look({ head, projection, view }) {
    this.head = head;
    this.views = ["left", "right"].map((eye, i) => ({
      eye,
      projection: new Float32Array(projection),
      view: new Float32Array(view),
      viewport: { x: (i * WIDTH) / 2, y: 0, width: WIDTH / 2, height: HEIGHT },
    }));
  }

  // An image of one colour for each eye.
  async show(seq, left, right, { width = 64, height = 48, fovDeg = 60 } = {}) {
    const image = (color) => {
      const canvas = new OffscreenCanvas(width, height);
      const paint = canvas.getContext("2d");
      paint.fillStyle = color;
      paint.fillRect(0, 0, width, height);
      return createImageBitmap(canvas);
    };
    const [l, r] = await Promise.all([image(left), image(right)]);
    this.stage.show({ seq, takenMs: 0, fovDeg, left: l, right: r });
    return [l, r];
  }

  draw() {
    const seq = this.stage.draw(null, this.views, this.head, this.points, this.passthrough);
    if (seq !== null) {
      this.link?.shown(seq);
    }
    return seq;
  }

  hold(left, right, xyz) {
    this.points = { xyz: new Float32Array(xyz), left, right };
  }

  connect(url) {
    this.link = new VideoLink(url, { onFrame: (frame) => this.stage.show(frame) });
  }

  // Red, green, blue, opacity of an eye's pixel, counted from its left and top.
  pixel(eye, x, y) {
    const at = new Uint8Array(4);
    const column = Math.round(x) + (eye === "right" ? WIDTH / 2 : 0);
    this.gl.readPixels(column, HEIGHT - 1 - Math.round(y), 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, at);
    return [...at];
  }

  // Pixels of an eye, bottom row first, in base64.
  pixels(eye) {
    const all = new Uint8Array(4 * (WIDTH / 2) * HEIGHT);
    this.gl.readPixels(eye === "right" ? WIDTH / 2 : 0, 0, WIDTH / 2, HEIGHT, this.gl.RGBA, this.gl.UNSIGNED_BYTE, all);
    return btoa(Array.from(all, (byte) => String.fromCharCode(byte)).join(""));
  }
}

globalThis.rig = new Rig();
