/**
 * The pose socket from the page's side: packets and messages up, HUD and pings down.
 *
 * | it ends because                                 | then                                                           |
 * |-------------------------------------------------|----------------------------------------------------------------|
 * | the server is gone, or silent for 3 s           | tried again, after 0.25 s at first and 4 s at last             |
 * | another headset is connected (4409)             | tried again                                                    |
 * | another headset has taken over (4409)           | stays down until a person connects again: two would take turns |
 * | the token is wrong or missing (4401)            | stays down: a new token takes a new address                    |
 *
 * The link is open when the server has said something: a socket that opens is closed at once where it is not wanted.
 * Packets are made to be sent now or never. What the network does not take in time is dropped, not queued.
 */

const UNAUTHORIZED = 4401;
const BUSY = 4409;
const FIRST_WAIT = 250;
const LONGEST_WAIT = 4000;
/** The server speaks twenty times a second [ms]. */
const SILENCE = 3000;
/** About ten packets. */
const MAX_BUFFERED = 8192;

const CONNECTING = "connecting to ik-xr";
const GONE = "no connection to ik-xr";
const NO_ANSWER = "ik-xr does not answer: is it running, and is this device in its network?";
const SILENT = "ik-xr says nothing any more: is the network there?";
const NOT_WANTED =
  "ik-xr answers, but this page may not connect: install its certificate in the headset, and open the address that " +
  "ik-xr printed";

export class PoseLink {
  /**
   * Connect, and stay connected.
   *
   * @param {string} url Of the socket, with the token.
   * @param {object} options
   * @param {object} options.hello `page` and `device`, to introduce the page.
   * @param {(state: object) => void} options.onState Called with `state` whenever it has changed.
   * @param {(hud: object) => void} options.onHud Called with each HUD.
   */
  constructor(url, { hello, onState, onHud }) {
    /** `open`; `reason` in words, empty while open; `stopped`: only `connect` helps; `refused`: not even that. */
    this.state = { open: false, reason: CONNECTING, stopped: false, refused: false };
    this._url = url;
    this._hello = hello;
    this._onState = onState;
    this._onHud = onHud;
    this._socket = null;
    this._heard = 0;
    this._wait = FIRST_WAIT;
    this._timer = 0;
    /** The best guess why a socket does not open; browsers do not say. */
    this._guess = GONE;
    setInterval(() => this._checkSilence(), SILENCE / 6);
    this.connect();
  }

  /** Connect now, whatever has been before. */
  connect() {
    this._drop();
    this._wait = FIRST_WAIT;
    this._become({ open: false, reason: CONNECTING, stopped: false, refused: false });
    this._open();
  }

  /**
   * Send a packet, unless the link is not open or the network is behind.
   *
   * @param {Uint8Array} packet
   * @returns {boolean} Whether it was sent.
   */
  send(packet) {
    if (!this.state.open || this._socket.readyState !== WebSocket.OPEN || this._socket.bufferedAmount > MAX_BUFFERED) {
      return false;
    }
    this._socket.send(packet);
    return true;
  }

  /** Tell the server that a person has looked at the fault. */
  clear() {
    this._say({ type: "clear" });
  }

  _open() {
    const socket = new WebSocket(this._url);
    socket.binaryType = "arraybuffer";
    this._socket = socket;
    this._heard = performance.now();
    // A socket that was given up may still speak; nobody listens to it any more.
    const mine = (handle) => (event) => this._socket === socket && handle(event);
    socket.onopen = mine(() => this._say({ type: "hello", ...this._hello }));
    socket.onmessage = mine(({ data }) => this._hear(JSON.parse(data)));
    socket.onclose = mine(({ code, reason }) => this._lose(code, reason));
  }

  /** Give the socket up without waiting for its goodbye: on a dead network that may take long. */
  _drop() {
    clearTimeout(this._timer);
    const socket = this._socket;
    this._socket = null;
    socket?.close();
  }

  _hear(message) {
    this._heard = performance.now();
    if (!this.state.open) {
      this._wait = FIRST_WAIT;
      this._guess = GONE;
      this._become({ open: true, reason: "" });
    }
    if (message.type === "ping") {
      this._say({ type: "pong", t_ms: message.t_ms, page_ms: performance.now() });
    } else if (message.type === "hud") {
      this._onHud(message);
    }
  }

  _lose(code, reason) {
    const wasOpen = this.state.open;
    const refused = code === UNAUTHORIZED;
    const stopped = refused || (code === BUSY && wasOpen);
    this._drop();
    this._become({ open: false, reason: reason || this._guess, stopped, refused });
    if (!stopped) {
      this._tryAgain();
      if (!wasOpen && !reason) {
        this._explain();
      }
    }
  }

  _tryAgain() {
    this._timer = setTimeout(() => this._open(), this._wait);
    this._wait = Math.min(2 * this._wait, LONGEST_WAIT);
  }

  _checkSilence() {
    if (this._socket !== null && performance.now() - this._heard > SILENCE) {
      this._lose(0, this.state.open ? SILENT : "");
    }
  }

  /** Guess why a socket did not open: whether the server answers at all tells the two cases apart. */
  async _explain() {
    let answers = false;
    try {
      answers = (await fetch("icon.svg", { method: "HEAD", cache: "no-store" })).ok;
    } catch {
      // It does not.
    }
    const before = this._guess;
    this._guess = answers ? NOT_WANTED : NO_ANSWER;
    if (!this.state.open && this.state.reason === before) {
      this._become({ reason: this._guess });
    }
  }

  _say(message) {
    if (this._socket?.readyState === WebSocket.OPEN) {
      this._socket.send(JSON.stringify(message));
    }
  }

  _become(change) {
    const before = JSON.stringify(this.state);
    Object.assign(this.state, change);
    if (JSON.stringify(this.state) !== before) {
      this._onState(this.state);
    }
  }
}

/**
 * Where a socket of this page is.
 *
 * @param {string} path Of the socket: "pose" or "video".
 * @param {string} token
 * @returns {string} Its URL.
 */
export function socketUrl(path, token) {
  const url = new URL(`/${path}`, location.href);
  url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  url.search = new URLSearchParams({ token }).toString();
  url.hash = "";
  return url.href;
}
