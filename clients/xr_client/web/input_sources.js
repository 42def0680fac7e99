/**
 * Which of a session's input sources are the operator's two hands.
 *
 * A hand and a controller may be there for the same side at the same time; then the controller counts while its grip is
 * tracked. Gazes, screens, transient pointers and sources without a side are nobody's hand.
 */

/** What is there for one side in this frame. Kept and filled again. */
class Side {
  constructor() {
    this.hand = null;
    this.controller = null;
  }

  add(source) {
    if (source.hand) {
      this.hand ??= source;
    } else if (source.gripSpace) {
      this.controller ??= source;
    }
  }
}

export class InputSources {
  constructor() {
    this.sides = [new Side(), new Side()];
  }

  /**
   * Look through the sources of a frame.
   *
   * @param {XRInputSourceArray} sources Of the session.
   * @returns {Side[]} Left and right, each {hand, controller}: sources or null.
   */
  sort(sources) {
    for (const side of this.sides) {
      side.hand = null;
      side.controller = null;
    }
    for (let k = 0; k < sources.length; k += 1) {
      const source = sources[k];
      if (source.targetRayMode !== "tracked-pointer") {
        continue;
      }
      if (source.handedness === "left") {
        this.sides[0].add(source);
      } else if (source.handedness === "right") {
        this.sides[1].add(source);
      }
    }
    return this.sides;
  }
}
