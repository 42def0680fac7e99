/**
 * What is done in a frame: first the poses go out, then the picture is drawn. Nothing is made anew per frame.
 *
 * `capture_ms` is `performance.now()` just before the frame is asked for its poses, on the clock that pongs tell. The
 * time a browser hands to the frame's callback is not used: devices differ in what they mean by it, and poses are
 * predicted to the time of display, which lies ahead.
 */

import { Kind, PacketWriter } from "./pose_packet.js";
import { PoseReader } from "./poses.js";

export class FrameLoop {
  /**
   * @param {object} parts
   * @param {object} parts.xr An `XrSession`.
   * @param {object} parts.link A `PoseLink`.
   * @param {object} parts.graphics A `Graphics`.
   * @param {() => object} parts.video Gives the `VideoLink`; null where there is none.
   * @param {object} parts.stats Counts `frames`, packets `sent` and `dropped`, images `shown`.
   */
  constructor({ xr, link, graphics, video, stats }) {
    this._xr = xr;
    this._link = link;
    this._graphics = graphics;
    this._video = video;
    this._stats = stats;
    this._reader = new PoseReader();
    this._writer = new PacketWriter();
    this._seq = 0;
    this._views = [];
    const { pose } = this._reader.content.head;
    this._head = { position: pose.subarray(0, 3), orientation: pose.subarray(3, 7) };
    this._points = { xyz: new Float32Array(2 * this._reader.content.hands[0].joints.length), left: 0, right: 0 };
  }

  /**
   * @param {XRFrame} frame
   */
  run(frame) {
    const { content } = this._reader;
    this._stats.frames += 1;
    content.captureMs = performance.now();
    const viewer = this._reader.read(frame, this._xr.space, this._xr.visible);
    this._send();
    if (viewer !== null) {
      this._draw(viewer);
    }
  }

  /** Say at once that nobody operates: no frame may come to say it later. */
  sayNobody() {
    this._reader.content.captureMs = performance.now();
    this._reader.forget();
    this._send();
  }

  _send() {
    const { content } = this._reader;
    this._seq += 1;
    content.seq = this._seq;
    content.epoch = this._xr.epoch;
    if (this._link.send(this._writer.write(content))) {
      this._stats.sent += 1;
    } else {
      this._stats.dropped += 1;
    }
  }

  _draw(viewer) {
    const { layer, passthrough } = this._xr;
    const count = viewer.views.length;
    while (this._views.length < count) {
      this._views.push({ eye: "none", projection: null, view: null, viewport: null });
    }
    this._views.length = count;
    for (let k = 0; k < count; k += 1) {
      const from = viewer.views[k];
      const to = this._views[k];
      to.eye = from.eye;
      to.projection = from.projectionMatrix;
      to.view = from.transform.inverse.matrix;
      to.viewport = layer.getViewport(from);
    }
    const { head, hands } = this._reader.content;
    const points = this._points;
    points.left = putPoints(hands[0], points.xyz, 0);
    points.right = putPoints(hands[1], points.xyz, points.left);
    const { stage } = this._graphics;
    const seq = stage.draw(layer.framebuffer, this._views, head.tracked ? this._head : null, points, passthrough);
    if (seq !== null) {
      this._stats.shown += 1;
      this._video()?.shown(seq);
    }
  }
}

/** Copy what is to be seen of a hand behind `from` points; gives their number. */
function putPoints(hand, xyz, from) {
  if (hand.jointsKnown) {
    xyz.set(hand.joints, 3 * from);
    return hand.joints.length / 3;
  }
  if (hand.kind === Kind.CONTROLLER && hand.tracked) {
    xyz[3 * from] = hand.pose[0];
    xyz[3 * from + 1] = hand.pose[1];
    xyz[3 * from + 2] = hand.pose[2];
    return 1;
  }
  return 0;
}
