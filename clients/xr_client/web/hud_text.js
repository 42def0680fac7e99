/**
 * What a person in VR reads, as data. Pure: states in, words and their tones out. `HudPanel` and `NoticePanel` draw
 * them.
 *
 * Words are calm, and say what to do. Numbers are rounded to what one can read, so that text seldom changes.
 */

import { OF_STATE } from "./tones.js";

/** How old a picture may be to pass for what happens now [ms]. */
export const OLD = 1000;

/**
 * @typedef {object} HudState
 * @property {object|null} hud The server's latest `hud` message; null before the first.
 * @property {{open: boolean, reason: string}|null} link The pose socket.
 * @property {{open: boolean, reason: string, fps: number, shownMs: number|null}|null} video The video socket.
 */

/**
 * @typedef {{text: string, tone: string}} Line Words and the name of their colour, see `tones.js`.
 * @typedef {{name: string, state: string, tone: string, figure: string, detail: Line}} ArmText An arm.
 * @typedef {{arms: [ArmText, ArmText], note: Line, footer: string}} HudText The panel.
 */

const WORDS = { disarmed: "disarmed", aligning: "engaging", active: "active", hold: "holding", fault: "fault" };
/** What to do, beside the reason; a state without a reason has not been left since the start. */
const BEGIN = "grip to engage";
const ADVICE = {
  disarmed: "let go and grip again",
  aligning: "keep the grip",
  hold: "let go and grip again",
  fault: "look at the robot, then clear the fault on the page",
};
/** The server's stages that a person gets to see, and their names. */
const STAGES = { command: "hand to robot", headset: "poses", service: "service", video: "picture" };

/**
 * What the panel says.
 * @param {HudState} state How things are.
 * @returns {HudText} The words.
 */
export function hudText({ hud, link, video }) {
  const connected = Boolean(link?.open && hud);
  return {
    arms: [armText("left arm", connected ? hud.left : null), armText("right arm", connected ? hud.right : null)],
    note: noteText(hud, link),
    footer: footerText(connected ? hud : null, video),
  };
}

/**
 * What stands on the screen instead of the picture, or over it.
 * @param {HudState} state How things are.
 * @param {number|null} age Age of the latest image [ms]; null before the first.
 * @returns {string[]} Title and explanation; empty where the picture is fine.
 */
export function pictureNotice({ hud, link, video }, age) {
  if (age !== null && age <= OLD) {
    return [];
  }
  const closed = video?.open ? "" : video?.reason || "waiting for a connection";
  // The server's note tells of the robot first; where nothing graver is wrong it says why there are no pictures.
  const trouble = link?.open && hud?.note.includes("no pictures") ? hud.note.replace(/^no pictures: /, "") : "";
  if (age === null) {
    return ["no picture from the robot", closed || trouble || "connected, but no image has come yet"];
  }
  return [`picture is ${Math.floor(age / 1000)} s old`, closed || trouble || "the robot sends no new ones"];
}

function armText(name, arm) {
  if (arm === null) {
    return { name, state: "not known", tone: "idle", figure: "", detail: { text: "", tone: "quiet" } };
  }
  const { state, reason, warning, position_error_mm: distance } = arm;
  const following = state === "active" && distance !== null;
  const detail = warning ? { text: warning, tone: "wait" } : { text: advised(state, reason), tone: "plain" };
  return {
    name,
    state: WORDS[state] ?? state,
    tone: OF_STATE[state] ?? "bad",
    figure: following ? `${Math.round(distance)} mm from target` : "",
    detail,
  };
}

/** The reason, and what to do about it where it does not say so itself. */
function advised(state, reason) {
  const advice = ADVICE[state] ?? "";
  if (!reason) {
    return state === "disarmed" ? BEGIN : advice;
  }
  return advice && !reason.includes("to engage") ? `${reason}; ${advice}` : reason;
}

function noteText(hud, link) {
  if (!link?.open) {
    return { text: `no connection to ik-xr: ${link?.reason || "connecting"}`, tone: "bad" };
  }
  if (hud === null) {
    return { text: "connected, waiting for the robot's state", tone: "quiet" };
  }
  return { text: hud.note, tone: "wait" };
}

function footerText(hud, video) {
  const parts = [];
  for (const [stage, name] of Object.entries(STAGES)) {
    const latency = hud?.latency_ms[stage];
    if (typeof latency === "number") {
      parts.push(`${name} ${readable(latency)}`);
    }
  }
  if (video?.open && video.fps > 0) {
    parts.push(`${Math.round(video.fps)} images/s`);
  }
  return parts.join("  ·  ");
}

function readable(ms) {
  return ms < 1 ? "<1 ms" : `${Math.round(ms)} ms`;
}
