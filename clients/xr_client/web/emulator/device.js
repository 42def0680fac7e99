/**
 * The emulated headset: a Quest 3 made of IWER, which the page takes for a real one.
 *
 * Two things about IWER are put right:
 *
 * - It interpolates between a resting and a pinching hand that were captured apart, so its wrist jumps by 25 mm when
 *   fingers close, and an arm that follows would jump as well. Here the pinching hand is brought to the resting wrist:
 *   only fingers move.
 * - It says that the place of each controller is a guess, which the page takes for a lost one. Here it is known.
 */

import { compose, between, poseOf } from "./rotation.js";

/** Hands, and everything else that comes in pairs. */
export const SIDES = ["left", "right"];

/** What a Quest 3 shows from top to bottom [rad]. */
const FIELD_OF_VIEW = (96 * Math.PI) / 180;

/** Where a standing person's head is [m]. */
export const HEAD = [0, 1.6, 0];

/**
 * Make the device and let the browser offer it to pages.
 *
 * @param {object} iwer The global object of IWER's script.
 * @returns {object} The device, an `IWER.XRDevice`.
 */
export function installDevice(iwer) {
  const device = new iwer.XRDevice(iwer.metaQuest3, { stereoEnabled: true, fovy: FIELD_OF_VIEW });
  device.installRuntime({ forceInstall: true });
  device.primaryInputMode = "hand";
  device.position.set(...HEAD);
  for (const side of SIDES) {
    keepWristWhilePinching(device.hands[side][iwer.P_HAND_INPUT]);
    device.hands[side].updateHandPose();
    device.controllers[side].inputSource.gripSpace[iwer.P_SPACE].emulated = false;
  }
  return device;
}

/**
 * Where the page sees a hand: its wrist joint, or the grip of its controller, seen from what the device is told to move.
 *
 * @param {object} iwer The global object of IWER's script.
 * @param {object} input A hand or controller of the device.
 */
export function trackedPoint(iwer, input) {
  const { hand, gripSpace } = input.inputSource;
  return poseOf((hand ? hand.get("wrist") : gripSpace)[iwer.P_SPACE].offsetMatrix);
}

function keepWristWhilePinching(state) {
  const { default: resting, pinch } = state.poses;
  const wrist = poseOf(resting.jointTransforms.wrist.offsetMatrix);
  const pinching = poseOf(pinch.jointTransforms.wrist.offsetMatrix);
  const jointTransforms = {};
  for (const [name, joint] of Object.entries(pinch.jointTransforms)) {
    const moved = compose(wrist, between(pinching, poseOf(joint.offsetMatrix)));
    jointTransforms[name] = { ...joint, offsetMatrix: matrixOf(moved) };
  }
  // Both hands share one object of poses, so each gets its own.
  state.poses = { ...state.poses, pinch: { ...pinch, jointTransforms } };
}

function matrixOf({ position: [x, y, z], orientation: [qx, qy, qz, qw] }) {
  return new XRRigidTransform({ x, y, z }, { x: qx, y: qy, z: qz, w: qw }).matrix;
}
