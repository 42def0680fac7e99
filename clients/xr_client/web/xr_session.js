/**
 * The immersive session: entering and leaving it, its frames, and the epoch of its room.
 *
 * The epoch rises when poses from now on are not to be compared with those before: in a new session, when the view is
 * recentred, and whenever the session becomes visible or hidden or gets a menu in front of it. It never falls while the
 * page lives.
 */

const FEATURES = { requiredFeatures: ["local-floor"], optionalFeatures: ["hand-tracking"] };

export class XrSession {
  /**
   * @param {object} options
   * @param {(frame: XRFrame) => void} options.onFrame Called in each frame.
   * @param {() => void} options.onRecenter Called when the room has moved, or is new.
   * @param {() => void} options.onHidden Called when the operator does not see the page any more, or has left.
   * @param {() => void} options.onEnd Called when the session is over.
   */
  constructor({ onFrame, onRecenter, onHidden, onEnd }) {
    this.epoch = 0;
    /** @type {XRSession|null} */
    this.session = null;
    /** @type {XRReferenceSpace|null} With the floor at y = 0. */
    this.space = null;
    /** @type {XRWebGLLayer|null} */
    this.layer = null;
    this._entering = false;
    this._onFrame = onFrame;
    this._onRecenter = onRecenter;
    this._onHidden = onHidden;
    this._onEnd = onEnd;
    this._tick = (_time, frame) => {
      // Asked for first: whatever goes wrong in this frame, there is a next one.
      frame.session.requestAnimationFrame(this._tick);
      this._onFrame(frame);
    };
  }

  /** Whether there is a session, or is about to be. */
  get busy() {
    return this._entering || this.session !== null;
  }

  /** Whether the operator sees the page, and not a menu in front of it. */
  get visible() {
    return this.session?.visibilityState === "visible";
  }

  /** Whether the operator sees the surroundings behind what is drawn. */
  get passthrough() {
    return this.session !== null && this.session.environmentBlendMode !== "opaque";
  }

  /**
   * Enter. Must be called from a press of a button: browsers allow it only there.
   *
   * @param {"immersive-vr"|"immersive-ar"} mode
   * @param {() => WebGL2RenderingContext} openGl Gives what to draw with, asked for once the session is granted.
   * @throws {Error} As the browser names it, where there is no session.
   */
  async enter(mode, openGl) {
    this._entering = true;
    let session = null;
    try {
      session = await navigator.xr.requestSession(mode, FEATURES);
      let over = false;
      session.addEventListener("end", () => {
        over = true;
        this._end(session);
      });
      const layer = new XRWebGLLayer(session, openGl());
      session.updateRenderState({ baseLayer: layer });
      const space = await session.requestReferenceSpace("local-floor");
      if (over) {
        throw new DOMException("the session ended before it had begun", "AbortError");
      }
      this._begin(session, space, layer);
    } catch (error) {
      session?.end().catch(() => {});
      throw error;
    } finally {
      this._entering = false;
    }
  }

  /** Leave, if there is a session. */
  leave() {
    this.session?.end().catch(() => {});
  }

  _begin(session, space, layer) {
    this.session = session;
    this.space = space;
    this.layer = layer;
    this.epoch += 1;
    space.addEventListener("reset", () => {
      this.epoch += 1;
      this._onRecenter();
    });
    session.addEventListener("visibilitychange", () => {
      this.epoch += 1;
      if (!this.visible) {
        this._onHidden();
      }
    });
    this._onRecenter();
    session.requestAnimationFrame(this._tick);
  }

  _end(session) {
    if (session === this.session) {
      this.session = null;
      this._onHidden();
      this._onEnd();
    }
  }
}
