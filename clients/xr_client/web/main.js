/**
 * The page of ik-xr: poses of head and hands go to the server, the robot's picture and state come back.
 *
 * This file only puts the parts together. `globalThis.ikxr` shows what goes on, for tests and for the curious.
 */

import { runChecks } from "./checks.js";
import { deviceWords } from "./device.js";
import { watchForErrors, whyNotEntered } from "./failures.js";
import { FirstPage } from "./first_page.js";
import { FrameLoop } from "./frame_loop.js";
import { Graphics } from "./graphics.js";
import { buzz } from "./haptics.js";
import { PoseLink, socketUrl } from "./pose_link.js";
import { viewMode } from "./preferences.js";
import { VideoLink } from "./video_link.js";
import { XrSession } from "./xr_session.js";

const VERSION = "1";
const NO_LINK = { open: false, reason: "the address has no token", stopped: true, refused: true };
const NO_VIDEO = { open: false, reason: "it comes when you enter", fps: 0, shownMs: null };
/** How often the page outside of the headset is brought up to date while a session runs [ms]. */
const MIRROR_PERIOD = 500;
const LOST = "The headset took the graphics away, so the session has ended and the arms hold. Enter again.";

const token = location.hash.slice(1);

/** What goes on, for everything that shows it. */
const ikxr = {
  page: VERSION,
  stats: {
    frames: 0,
    sent: 0,
    dropped: 0,
    shown: 0,
    get undecodable() {
      return video?.count.undecodable ?? 0;
    },
  },
  hud: null,
  link: NO_LINK,
  get video() {
    return video?.state ?? NO_VIDEO;
  },
  get session() {
    return xr.session;
  },
  get epoch() {
    return xr.epoch;
  },
};
globalThis.ikxr = ikxr;

const page = new FirstPage({
  enter,
  view: (mode) => graphics.stage && (graphics.stage.mode = mode),
  clear: () => link.clear(),
  connect: () => link.connect(),
});
watchForErrors((words) => page.showFault(words));

let video = null;
let mirrorDue = 0;
const graphics = new Graphics(document.getElementById("view"), () => {
  page.showFault(LOST);
  xr.leave();
});
const xr = new XrSession({
  onFrame: (frame) => loop.run(frame),
  onRecenter: () => graphics.stage.recenter(),
  onHidden: () => loop.sayNobody(),
  onEnd: ended,
});
const link = token
  ? new PoseLink(socketUrl("pose", token), {
      hello: { page: VERSION, device: deviceWords() },
      onState: connectionChanged,
      onHud: hear,
    })
  : null;
const loop = new FrameLoop({ xr, link, graphics, video: () => video, stats: ikxr.stats });

connectionChanged(link?.state ?? NO_LINK);
check();
// Another token in the same address does not load the page anew by itself.
addEventListener("hashchange", () => location.reload());
navigator.xr?.addEventListener("devicechange", check);
// The headset lets the operator in without a press of a button, on the way from another page.
navigator.xr?.addEventListener("sessiongranted", (event) => enter(event.session?.mode ?? "immersive-vr"));

async function check() {
  page.showChecks(await runChecks(token));
}

function connectionChanged(state) {
  ikxr.link = state;
  page.showConnection(state);
  page.showRobot(ikxr);
}

function hear(hud) {
  if (xr.session !== null) {
    buzz(xr.session.inputSources, ikxr.hud, hud);
  }
  ikxr.hud = hud;
  // Nobody looks at the page while the headset shows the session, and writing text takes time from its frames.
  const now = performance.now();
  if (xr.session === null || now >= mirrorDue) {
    mirrorDue = now + MIRROR_PERIOD;
    page.showRobot(ikxr);
  }
}

async function enter(mode) {
  if (link === null || xr.busy) {
    return;
  }
  page.showFault("");
  page.showSession("entering");
  try {
    await xr.enter(mode, () => graphics.open());
    graphics.stage.mode = viewMode();
    graphics.stage.hud(ikxr);
    // The robot's pictures are made only for those who watch, so nobody watches from the page.
    video = new VideoLink(socketUrl("video", token), { onFrame: (frame) => graphics.stage.show(frame) });
    page.showSession("in");
  } catch (error) {
    page.showFault(whyNotEntered(error));
    page.showSession("");
  }
}

function ended() {
  video?.close();
  video = null;
  page.showSession("");
}
