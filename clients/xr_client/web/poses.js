/**
 * What a WebXR frame has seen of head and hands, as the content of a pose packet. Nothing is made anew per frame.
 *
 * | of         | tracked                                     | also                                               |
 * |------------|---------------------------------------------|----------------------------------------------------|
 * | head       | the viewer has a pose                       | guessed: the headset only thinks it is there       |
 * | hand       | the wrist joint has a pose that is no guess | joints if all 25 are there; pinch if both tips are |
 * | controller | its grip has a pose that is no guess        | buttons are known without a pose as well           |
 *
 * A pose that is no pose (not finite, more than 100 m away, a quaternion that is not of unit length) is not there, and
 * triggers and thumbsticks are brought into their range: one odd number must not cost the whole packet.
 */

import { InputSources } from "./input_sources.js";
import { JOINTS, Kind, newContent } from "./pose_packet.js";

/** The joints in WebXR's order. */
export const JOINT_NAMES = ["wrist"].concat(
  ["metacarpal", "phalanx-proximal", "phalanx-distal", "tip"].map((part) => `thumb-${part}`),
  ...["index", "middle", "ring", "pinky"].map((finger) =>
    ["metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip"].map(
      (part) => `${finger}-finger-${part}`,
    ),
  ),
);
const WRIST = 0;
const THUMB_TIP = JOINT_NAMES.indexOf("thumb-tip");
const INDEX_TIP = JOINT_NAMES.indexOf("index-finger-tip");

/** The packet's limits [m]. */
const MAX_POSITION = 100;
const MAX_PINCH = 1;
/** Tighter than the packet's 1e-2, so that no rounding decides. */
const UNIT_TOLERANCE = 5e-3;

/** Buttons and axes of the mapping "xr-standard". */
const TRIGGER = 0;
const SQUEEZE = 1;
const THUMBSTICK = 3;
const LOWER = 4;
const UPPER = 5;
const STICK_X = 2;
const STICK_Y = 3;

export class PoseReader {
  constructor() {
    this.content = newContent();
    this._sources = new InputSources();
  }

  /**
   * Read a frame into `content`; its numbers, epoch and time are left alone.
   *
   * @param {XRFrame} frame
   * @param {XRReferenceSpace} space Where poses are given.
   * @param {boolean} visible Whether the operator sees the page.
   * @returns {XRViewerPose|null} Where the views are; null where the headset does not know.
   */
  read(frame, space, visible) {
    const { content } = this;
    const viewer = frame.getViewerPose(space) ?? null;
    content.visible = visible;
    content.head.tracked = putPose(viewer, content.head.pose);
    content.head.guessed = content.head.tracked && viewer.emulatedPosition;
    const sides = this._sources.sort(frame.session.inputSources);
    for (let side = 0; side < sides.length; side += 1) {
      readSide(content.hands[side], sides[side], frame, space);
    }
    return viewer;
  }

  /** Fill `content` with nothing at all: the operator is gone, or sees something else. */
  forget() {
    const { content } = this;
    content.visible = false;
    content.head.tracked = false;
    content.hands.forEach(clear);
  }
}

function readSide(into, { hand, controller }, frame, space) {
  clear(into);
  if (controller !== null) {
    into.tracked = putKnownPose(frame.getPose(controller.gripSpace, space), into.pose);
    if (into.tracked || hand === null) {
      into.kind = Kind.CONTROLLER;
      readGamepad(into, controller.gamepad);
      return;
    }
  }
  if (hand !== null) {
    into.kind = Kind.HAND;
    readHand(into, hand.hand, frame, space);
  }
}

function readHand(into, hand, frame, space) {
  const { joints } = into;
  let known = 0;
  let tips = 0;
  for (let k = 0; k < JOINTS; k += 1) {
    const joint = hand.get(JOINT_NAMES[k]);
    const pose = joint ? frame.getJointPose(joint, space) : null;
    if (k === WRIST) {
      into.tracked = putKnownPose(pose, into.pose);
    }
    if (pose && putPosition(pose.transform.position, joints, 3 * k)) {
      known += 1;
      tips += k === THUMB_TIP || k === INDEX_TIP ? 1 : 0;
    }
  }
  into.jointsKnown = known === JOINTS;
  if (tips === 2) {
    into.pinch = distance(joints, 3 * THUMB_TIP, 3 * INDEX_TIP);
    into.pinchKnown = into.pinch <= MAX_PINCH;
  }
}

function readGamepad(into, gamepad) {
  if (!gamepad || gamepad.mapping !== "xr-standard") {
    return;
  }
  const { buttons, axes } = gamepad;
  into.trigger = clamped(buttons[TRIGGER]?.value, 0);
  into.squeeze = clamped(buttons[SQUEEZE]?.value, 0);
  into.stickX = clamped(axes[STICK_X], -1);
  into.stickY = clamped(axes[STICK_Y], -1);
  into.buttons =
    (buttons[LOWER]?.pressed ? 1 : 0) | (buttons[UPPER]?.pressed ? 2 : 0) | (buttons[THUMBSTICK]?.pressed ? 4 : 0);
}

function clear(hand) {
  hand.kind = Kind.NONE;
  hand.tracked = false;
  hand.trigger = 0;
  hand.squeeze = 0;
  hand.stickX = 0;
  hand.stickY = 0;
  hand.buttons = 0;
  hand.pinchKnown = false;
  hand.jointsKnown = false;
}

/** Copy a pose; false where there is none. */
function putPose(pose, into) {
  if (!pose || !putPosition(pose.transform.position, into, 0)) {
    return false;
  }
  const { x, y, z, w } = pose.transform.orientation;
  into[3] = x;
  into[4] = y;
  into[5] = z;
  into[6] = w;
  // Written so that NaN fails.
  return Math.abs(Math.hypot(x, y, z, w) - 1) <= UNIT_TOLERANCE;
}

/** Copy a pose of a hand; a position that the headset only guesses is none. */
function putKnownPose(pose, into) {
  return putPose(pose, into) && !pose.emulatedPosition;
}

function putPosition({ x, y, z }, into, at) {
  into[at] = x;
  into[at + 1] = y;
  into[at + 2] = z;
  return Math.abs(x) <= MAX_POSITION && Math.abs(y) <= MAX_POSITION && Math.abs(z) <= MAX_POSITION;
}

function distance(points, a, b) {
  return Math.hypot(points[a] - points[b], points[a + 1] - points[b + 1], points[a + 2] - points[b + 2]);
}

function clamped(value, lowest) {
  return Number.isFinite(value) ? Math.min(Math.max(value, lowest), 1) : 0;
}
