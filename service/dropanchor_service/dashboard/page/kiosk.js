/** The page on a wall (`?kiosk`): large type, no controls, and a screen that stays on. `?kiosk=tags` shows one tag after another,
 * `?kiosk=floors` one floor after another. */

import { addressValues } from "../data/address.js";
import { timeText } from "../i18n/language.js";
import { byId, write } from "./parts.js";

const EVERY_S = 10;
const SHORTEST_S = 2;

/** Whether the page is on a wall. */
export const isKiosk = addressValues().has("kiosk");

/** Return the address of the wall with the present view. @param {Location} location */
export function kioskAddress({ origin, pathname, search, hash }) {
  const query = new URLSearchParams(search);
  query.set("kiosk", "");
  return `${origin}${pathname}?${query.toString().replace(/kiosk=(?=&|$)/, "kiosk")}${hash}`;
}

/** @typedef {{names: () => string[], show: (name: string) => void}} Series in their order */

export class Kiosk {
  /** @param {Record<string, Series>} series what the wall can show one after another, by the value of `kiosk` */
  constructor(series) {
    if (!isKiosk) return;
    document.body.dataset.kiosk = "";
    stayAwake();
    showTime();
    setInterval(showTime, 1000);
    document.addEventListener("visibilitychange", stayAwake);
    document.addEventListener("keydown", ({ key }) => key === "Escape" && leave());
    const values = addressValues();
    const every_s = Math.max(SHORTEST_S, Number(values.get("every")) || EVERY_S);
    const chosen = series[values.get("kiosk") ?? ""];
    if (chosen) setInterval(() => this.#next(chosen), every_s * 1000);
  }

  #shown = "";

  /** @param {Series} series */
  #next({ names, show }) {
    const all = names();
    if (all.length === 0) return;
    this.#shown = all[(all.indexOf(this.#shown) + 1) % all.length];
    show(this.#shown);
  }
}

/** Show the time of day, by which a glance also tells that the page is alive. */
function showTime() {
  write(byId("wall-clock"), timeText(new Date(), { timeStyle: "medium" }));
}

/** Keep the screen on while the page is visible. A browser that cannot leaves that to the system. */
function stayAwake() {
  if (document.visibilityState === "visible") navigator.wakeLock?.request("screen").catch(() => undefined);
}

function leave() {
  const query = new URLSearchParams(location.search);
  query.delete("kiosk");
  location.search = query.toString();
}
