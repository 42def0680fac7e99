/**
 * Images from the server, on a socket of their own so that they never hold up poses.
 *
 * - Latest wins: while a pair is being decoded one more waits, and a newer one takes its place.
 * - The server sends the next image when it hears that one was shown. What was passed over for a newer one is
 *   acknowledged with it, what cannot be decoded at once: credit always comes back, and a page that stops drawing stops
 *   the flow.
 * - A lost connection is tried again after 0.25 s, doubling to 4 s; not after a wrong token, which needs another URL.
 */

import { readVideoPacket } from "./video_packet.js";

const UNAUTHORIZED = 4401;
const FIRST_PAUSE = 250;
const LONGEST_PAUSE = 4000;
/** Over what time images are counted for `state.fps` [ms]. */
const FPS_WINDOW = 1000;
/** For decoding as the texture takes them: no colour management, which costs time. */
const DECODING = { colorSpaceConversion: "none" };

/** The page's end of the video socket. */
export class VideoLink {
  /**
   * Connect.
   * @param {string} url Of the socket, with the token.
   * @param {object} handlers
   * @param {(frame: {seq: number, takenMs: number, fovDeg: number, left: ImageBitmap, right: ImageBitmap}) => void}
   *   handlers.onFrame Gets each decoded image, and closes it.
   * @param {(state: object) => void} [handlers.onState] Gets `state` when the connection opens or ends.
   */
  constructor(url, { onFrame, onState = () => {} }) {
    /** Images that came, that were drawn, and that could not be decoded. */
    this.count = { received: 0, shown: 0, undecodable: 0 };
    this._url = url;
    this._onFrame = onFrame;
    this._onState = onState;
    this._pause = FIRST_PAUSE;
    this._timer = 0;
    this._ended = false;
    this._foreign = "";
    this._current = { open: false, reason: "connecting", fps: 0, shownMs: null };
    this._window = { since: 0, shown: 0 };
    this._connect();
  }

  /**
   * How the connection is: the same object each time.
   *   `open`, `reason` (why not, in words), `fps` (images shown in a second), `shownMs` (how long after its arrival the
   *   latest image had been drawn [ms], null before).
   */
  get state() {
    if (performance.now() - this._window.since > 2 * FPS_WINDOW) {
      this._current.fps = 0;
    }
    return this._current;
  }

  /**
   * An image has been drawn. Call it after the frame's drawing.
   * @param {number} seq Its number.
   */
  shown(seq) {
    const until = this._underWay.findIndex((image) => image.seq === seq);
    if (until < 0) {
      return; // of a connection before this one
    }
    const images = this._underWay.splice(0, until + 1);
    images.forEach((image) => this._acknowledge(image.seq));
    this.count.shown += 1;
    const now = performance.now();
    this._current.shownMs = now - images.at(-1).came;
    this._countFps(now);
  }

  /** End it for good. */
  close() {
    this._ended = true;
    clearTimeout(this._timer);
    this._socket.close();
  }

  _connect() {
    this._underWay = [];
    this._next = null;
    this._decoding = false;
    const socket = new WebSocket(this._url);
    this._socket = socket;
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this._say(true, "");
    };
    socket.onmessage = ({ data }) => {
      this._pause = FIRST_PAUSE;
      this._take(data, socket);
    };
    socket.onclose = ({ code, reason }) => {
      this._next = null;
      this._ended ||= code === UNAUTHORIZED;
      this._say(false, this._foreign || reason || "the connection was lost");
      if (!this._ended) {
        this._timer = setTimeout(() => this._connect(), this._pause);
        this._pause = Math.min(2 * this._pause, LONGEST_PAUSE);
      }
    };
  }

  _take(data, socket) {
    const packet = readVideoPacket(data);
    if (packet === null) {
      this._foreign = "images come in a form that this page does not know: reload the page";
      this.close();
      return;
    }
    this.count.received += 1;
    this._underWay.push({ seq: packet.seq, came: performance.now() });
    this._next = packet;
    if (!this._decoding) {
      this._decode(socket);
    }
  }

  async _decode(socket) {
    this._decoding = true;
    while (socket === this._socket && this._next !== null) {
      const packet = this._next;
      this._next = null;
      const [left, right] = await Promise.allSettled([bitmap(packet.left), bitmap(packet.right)]);
      const whole = left.status === "fulfilled" && right.status === "fulfilled";
      if (whole && socket === this._socket) {
        this._onFrame({ ...packet, left: left.value, right: right.value });
      } else {
        left.value?.close();
        right.value?.close();
        if (!whole) {
          this._refuse(packet.seq);
        }
      }
    }
    if (socket === this._socket) {
      this._decoding = false;
    }
  }

  _refuse(seq) {
    this.count.undecodable += 1;
    const at = this._underWay.findIndex((image) => image.seq === seq);
    if (at >= 0) {
      this._underWay.splice(at, 1);
      this._acknowledge(seq);
    }
  }

  _acknowledge(seq) {
    if (this._socket.readyState === WebSocket.OPEN) {
      this._socket.send(JSON.stringify({ type: "shown", seq }));
    }
  }

  _countFps(now) {
    this._window.shown += 1;
    const elapsed = now - this._window.since;
    if (elapsed >= FPS_WINDOW) {
      // After a pause the window is too long to say anything.
      this._current.fps = elapsed < 2 * FPS_WINDOW ? (1000 * this._window.shown) / elapsed : 0;
      this._window.since = now;
      this._window.shown = 0;
    }
  }

  _say(open, reason) {
    this._current.open = open;
    this._current.reason = reason;
    this._onState(this.state);
  }
}

function bitmap(jpeg) {
  return createImageBitmap(new Blob([jpeg], { type: "image/jpeg" }), DECODING);
}
