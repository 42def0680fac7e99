/**
 * What a person reads and presses before VR, and sees of the robot while nobody wears the headset.
 *
 * Texts are set only where they have changed, so that the page may be told of everything twenty times a second.
 */

import { hudText } from "./hud_text.js";
import { keepViewMode, viewMode } from "./preferences.js";

const MODES = { "enter-vr": "immersive-vr", "enter-ar": "immersive-ar" };
/** Checks without which neither mode can be entered. */
const NEEDED = ["secure", "token", "webxr", "webgl"];

export class FirstPage {
  /**
   * @param {object} on What a person does.
   * @param {(mode: string) => void} on.enter A button was pressed.
   * @param {(mode: string) => void} on.view Another way to see the picture was chosen.
   * @param {() => void} on.clear The fault has been looked at.
   * @param {() => void} on.connect To connect again.
   */
  constructor({ enter, view, clear, connect }) {
    this._checks = null;
    this._link = null;
    this._session = "";
    for (const [id, mode] of Object.entries(MODES)) {
      element(id).addEventListener("click", () => enter(mode));
    }
    element("clear-fault").addEventListener("click", clear);
    element("connect").addEventListener("click", connect);
    const select = element("view-mode");
    select.value = viewMode();
    select.addEventListener("change", () => {
      keepViewMode(select.value);
      view(select.value);
    });
    element("certificate").hidden = location.protocol !== "https:";
  }

  /** @param {object[]} checks As `runChecks` gives them. */
  showChecks(checks) {
    this._checks = Object.fromEntries(checks.map((check) => [check.name, check]));
    element("checks").replaceChildren(
      ...checks.map(({ state, words }) => {
        const item = document.createElement("li");
        item.className = state;
        item.textContent = words;
        return item;
      }),
    );
    document.body.classList.toggle("unready", checks.some(({ state }) => state === "bad"));
    this._showButtons();
  }

  /** @param {object} link State of the pose link. */
  showConnection(link) {
    this._link = link;
    const again = link.open || link.stopped ? "" : " (trying again)";
    setText("connection", link.open ? "connected to ik-xr" : `${link.reason}${again}`);
    element("connection").className = `pill ${link.open ? "good" : link.stopped ? "bad" : "wait"}`;
    element("connect").hidden = !link.stopped || link.refused;
    this._showButtons();
  }

  /** @param {""|"entering"|"in"} session Whether there is one. */
  showSession(session) {
    this._session = session;
    this._showButtons();
  }

  /** @param {object} state `hud`, `link` and `video`, as the stage gets them. */
  showRobot(state) {
    const { arms, note, footer } = hudText(state);
    arms.forEach((arm, k) => showArm(k === 0 ? "state-left" : "state-right", arm));
    const connected = Boolean(state.link.open && state.hud);
    setText("note", connected ? note.text : "");
    element("note").hidden = !connected || note.text === "";
    setText("latency", footer);
    const faulty = connected && [state.hud.left, state.hud.right].some((arm) => arm.state === "fault");
    element("clear-fault").hidden = !faulty;
  }

  /** @param {string} words What went wrong; empty takes it away. */
  showFault(words) {
    setText("fault", words);
    element("fault").hidden = words === "";
  }

  _showButtons() {
    const why = this._whyNot();
    element("enter-vr").disabled = why !== "" || this._checks.vr.state !== "good";
    element("enter-ar").disabled = why !== "" || this._checks.ar.state !== "good";
    setText("enter-why", why || this._whyNotThis());
  }

  /** Why nothing can be entered now; empty where it can. */
  _whyNot() {
    if (this._checks === null) {
      return "Looking at the browser.";
    }
    if (NEEDED.some((name) => this._checks[name].state === "bad")) {
      return "This device is not ready: see the crosses under “This device”.";
    }
    if (this._session !== "") {
      return this._session === "in" ? "You are in. Leave by the headset’s menu." : "Say yes to what the headset asks.";
    }
    if (!this._link?.open) {
      return "Not connected: see above.";
    }
    return "";
  }

  _whyNotThis() {
    const { vr, ar } = this._checks;
    if (vr.state !== "good") {
      return ar.state === "good" ? "Only AR is there on this device." : "This device is not ready: see the crosses.";
    }
    return ar.state === "good" ? "VR shows the robot’s picture only. AR shows your surroundings behind it." : ar.words;
  }
}

function showArm(id, { name, state, tone, figure, detail }) {
  const key = [state, tone, figure, detail.text].join("|");
  const place = element(id);
  if (place.dataset.shown === key) {
    return;
  }
  place.dataset.shown = key;
  const title = document.createElement("b");
  title.className = tone;
  title.textContent = `${name}: ${state}`;
  const words = document.createElement("small");
  words.textContent = [figure, detail.text].filter(Boolean).join("; ");
  place.replaceChildren(title, words);
}

function setText(id, text) {
  const place = element(id);
  if (place.textContent !== text) {
    place.textContent = text;
  }
}

function element(id) {
  return document.getElementById(id);
}
