/**
 * Puts an emulated headset into the browser before the page looks for one, and gives a person mouse and keys for it.
 *
 * For tests and for the browser's console: `xrDevice` is IWER's device, `xrOperator` the person who wears it.
 */

import { Controls } from "./controls.js";
import { installDevice } from "./device.js";
import { Help } from "./help.js";
import { Operator } from "./operator.js";

const device = installDevice(globalThis.IWER);
const operator = new Operator(device, globalThis.IWER);
const controls = new Controls(operator);
const help = new Help(operator, controls);

globalThis.xrDevice = device;
globalThis.xrOperator = operator;

function frame(now) {
  controls.step(now);
  operator.tremble(now);
  help.update();
  requestAnimationFrame(frame);
}
requestAnimationFrame(frame);
