/**
 * The pose packet as `xr_client/packets.py` lays it out, from the page's side: what a frame has seen in, bytes out.
 *
 * What is not there is written as zero, whatever the content holds in its place. Minus zero is never written, because
 * the server takes it for a second encoding of the same content. Whether numbers are in range is up to `poses.js`.
 */

const MAGIC = 0x50;
const VERSION = 1;
const HEAD_BYTES = 24;
const BASE_BYTES = 148;

/** Joints of a hand. */
export const JOINTS = 25;
const JOINT_BYTES = JOINTS * 3 * 4;

/** What a pose comes from. */
export const Kind = Object.freeze({ NONE: 0, HAND: 1, CONTROLLER: 2 });

const SESSION_HEAD = 1;
const SESSION_GUESSED = 2;
const SESSION_VISIBLE = 4;
const HAND_TRACKED = 1;
const HAND_KIND_SHIFT = 1;
const HAND_JOINTS = 8;
const HAND_PINCH = 16;
const HAND_BUTTON_SHIFT = 5;

/**
 * Content without anything in it, to be filled again and again.
 *
 * @returns {object} `seq`, `epoch`, `captureMs`, `visible`; `head` = {tracked, guessed, pose}; `hands`, left and right
 *   = {kind, tracked, pose, trigger, squeeze, stickX, stickY, buttons, pinchKnown, pinch, jointsKnown, joints}. A pose
 *   is position [m] and quaternion xyzw; `buttons` has a bit each for A or X, B or Y, and the thumbstick.
 */
export function newContent() {
  return {
    seq: 0,
    epoch: 0,
    captureMs: 0,
    visible: false,
    head: { tracked: false, guessed: false, pose: new Float32Array(7) },
    hands: [newHand(), newHand()],
  };
}

function newHand() {
  return {
    kind: Kind.NONE,
    tracked: false,
    pose: new Float32Array(7),
    trigger: 0,
    squeeze: 0,
    stickX: 0,
    stickY: 0,
    buttons: 0,
    pinchKnown: false,
    pinch: 0,
    jointsKnown: false,
    joints: new Float32Array(3 * JOINTS),
  };
}

/** Writes packets into one buffer. */
export class PacketWriter {
  constructor() {
    const buffer = new ArrayBuffer(BASE_BYTES + 2 * JOINT_BYTES);
    this._data = new DataView(buffer);
    // A packet has no, one or two hands with joints.
    this._packets = [0, 1, 2].map((hands) => new Uint8Array(buffer, 0, BASE_BYTES + hands * JOINT_BYTES));
    this._at = 0;
  }

  /**
   * Write a packet.
   *
   * @param {object} content As `newContent` makes it.
   * @returns {Uint8Array} The packet, valid until the next one is written.
   */
  write(content) {
    const { head, hands } = content;
    const [left, right] = hands;
    const data = this._data;
    data.setUint8(0, MAGIC);
    data.setUint8(1, VERSION);
    data.setUint8(2, sessionFlags(content));
    data.setUint8(3, handFlags(left));
    data.setUint8(4, handFlags(right));
    data.setUint32(8, content.seq, true);
    data.setUint32(12, content.epoch, true);
    data.setFloat64(16, content.captureMs, true);
    this._at = HEAD_BYTES;
    this._numbers(head.pose, head.tracked);
    this._hand(left);
    this._hand(right);
    let withJoints = 0;
    for (const hand of hands) {
      if (hand.jointsKnown) {
        this._numbers(hand.joints, true);
        withJoints += 1;
      }
    }
    return this._packets[withJoints];
  }

  _hand(hand) {
    const held = hand.kind === Kind.CONTROLLER;
    this._numbers(hand.pose, hand.tracked);
    this._number(held ? hand.trigger : 0);
    this._number(held ? hand.squeeze : 0);
    this._number(held ? hand.stickX : 0);
    this._number(held ? hand.stickY : 0);
    this._number(hand.pinchKnown ? hand.pinch : 0);
  }

  _numbers(numbers, known) {
    for (let k = 0; k < numbers.length; k += 1) {
      this._number(known ? numbers[k] : 0);
    }
  }

  _number(value) {
    // Rounded first: a tiny negative number becomes minus zero only then. Adding zero makes that plain zero.
    this._data.setFloat32(this._at, Math.fround(value) + 0, true);
    this._at += 4;
  }
}

function sessionFlags({ visible, head }) {
  return (
    (head.tracked ? SESSION_HEAD : 0) |
    (head.tracked && head.guessed ? SESSION_GUESSED : 0) |
    (visible ? SESSION_VISIBLE : 0)
  );
}

function handFlags(hand) {
  if (hand.kind === Kind.NONE) {
    return 0;
  }
  return (
    (hand.tracked ? HAND_TRACKED : 0) |
    (hand.kind << HAND_KIND_SHIFT) |
    (hand.jointsKnown ? HAND_JOINTS : 0) |
    (hand.pinchKnown ? HAND_PINCH : 0) |
    (hand.kind === Kind.CONTROLLER ? hand.buttons << HAND_BUTTON_SHIFT : 0)
  );
}
