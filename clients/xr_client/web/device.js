/** What the page runs on, in words for the person at the server. */

const BROWSERS = /(OculusBrowser|PicoBrowser|Wolvic|Firefox|Edg|Chrome|Version)\/(\d+)/;
const MOST = 200;

/** @returns {string} The system and the browser, at most 200 characters. */
export function deviceWords(userAgent = navigator.userAgent) {
  const system = /\(([^)]*)\)/.exec(userAgent)?.[1] ?? userAgent;
  const [, name, version] = BROWSERS.exec(userAgent) ?? [];
  const browser = name === "Version" ? "Safari" : name;
  return (browser ? `${system}, ${browser} ${version}` : system).slice(0, MOST);
}
