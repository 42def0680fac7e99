/**
 * Is this browser able? Each check says what it has found, and where it fails what to do.
 *
 * | check       | without it                       |
 * |-------------|----------------------------------|
 * | secure      | no headset                       |
 * | token       | no connection                    |
 * | webxr       | no headset                       |
 * | vr          | no VR, perhaps pass-through      |
 * | ar          | no pass-through; VR is enough    |
 * | webgl       | no picture                       |
 */

/** How long a browser may think about what it supports [ms]. */
const PATIENCE = 5000;

const VR_MODES = { vr: "immersive-vr", ar: "immersive-ar" };

/**
 * Look at the browser.
 *
 * @param {string} token Of the address; empty where there is none.
 * @param {object} browser What to look at; `globalThis` but in tests.
 * @returns {Promise<object[]>} Checks {name, state, words}, `state` being "good", "bad", or "none" for what is missing
 *   but not needed.
 */
export async function runChecks(token, browser = globalThis) {
  const secure = browser.isSecureContext;
  const xr = browser.navigator.xr;
  const [vr, ar] = await Promise.all([supports(xr, VR_MODES.vr), supports(xr, VR_MODES.ar)]);
  return [
    check("secure", secure, "The browser trusts this page.", INSECURE),
    check("token", token !== "", "The address carries the token of this run.", NO_TOKEN),
    check("webxr", Boolean(xr), "The browser has WebXR.", secure ? NO_WEBXR : NO_WEBXR_UNTRUSTED),
    check("vr", vr.ok, "Virtual reality is there.", vr.why),
    ar.ok ? check("ar", true, "Pass-through is there.") : { name: "ar", state: "none", words: NO_AR },
    check("webgl", hasWebGl(browser), "Graphics (WebGL 2) are there.", NO_WEBGL),
  ];
}

const INSECURE =
  "The browser does not trust this page, so it gives no hands and no headset. Install the certificate below, then " +
  "open the https address that ik-xr printed. Over a USB cable, open the localhost address instead.";
const NO_TOKEN =
  "The address has no token, so ik-xr would refuse this page. Open the whole address that ik-xr printed, or scan its " +
  "QR code.";
const NO_WEBXR =
  "This browser has no WebXR. Open this address in the headset's own browser: Meta Quest Browser, PICO Browser, or " +
  "Safari on Apple Vision Pro. Without a headset, start ik-xr with --emulate.";
const NO_WEBXR_UNTRUSTED = "WebXR is switched off on pages that the browser does not trust: see above.";
const NO_VR =
  "The browser finds no headset. Open this address in the browser of the headset itself, or connect the headset and " +
  "start its software, then reload this page.";
const NO_ANSWER =
  "The browser does not say whether virtual reality is there. Reload this page, or restart the headset.";
const FORBIDDEN =
  "The browser forbids virtual reality here. Allow it for this page in the browser's settings, then reload.";
const NO_AR = "Pass-through is not there. It is not needed.";
const NO_WEBGL =
  "Graphics (WebGL 2) are missing. Update the browser, and switch hardware acceleration on in its settings.";

function check(name, ok, good, bad) {
  return ok ? { name, state: "good", words: good } : { name, state: "bad", words: bad };
}

async function supports(xr, mode) {
  if (!xr) {
    return { ok: false, why: "Virtual reality needs WebXR: see above." };
  }
  let timer = 0;
  const late = new Promise((resolve) => {
    timer = setTimeout(() => resolve(null), PATIENCE);
  });
  try {
    const ok = await Promise.race([xr.isSessionSupported(mode), late]);
    return { ok: ok === true, why: ok === null ? NO_ANSWER : NO_VR };
  } catch (error) {
    return { ok: false, why: error.name === "SecurityError" ? FORBIDDEN : NO_VR };
  } finally {
    clearTimeout(timer);
  }
}

function hasWebGl(browser) {
  // Asked of a canvas of its own: the page's own context is made when it is needed, fit for the headset.
  return browser.document.createElement("canvas").getContext("webgl2") !== null;
}
