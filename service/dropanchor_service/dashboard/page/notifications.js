/** Notifications of the browser about chosen kinds of events. The browser asks for permission after a click, never before. */

import { chosen, remember } from "../data/display.js";
import { t } from "../i18n/language.js";
import { clock, kind, KINDS, sentence } from "../zones/words.js";
import { partOf, writeOrHide } from "./parts.js";

/** @typedef {import("../zones/words.js").ServiceEvent} ServiceEvent */

const COLLECT_MS = 1000;
/** More events at once make one notification that counts them. */
const MOST_AT_ONCE = 3;

export class Notifications {
  /** @type {Set<string>} */
  #kinds = new Set((chosen("notify", null) ?? "").split(",").filter((kind) => KINDS.includes(kind)));
  /** @type {ServiceEvent[]} */
  #waiting = [];

  /** @param {HTMLElement} box @param {import("../zones/event_log.js").EventLog} log @param {(event: ServiceEvent) => void} pick */
  constructor(box, log, pick) {
    this.pick = pick;
    this.problem = partOf(box, "problem");
    partOf(box, "kinds").append(...KINDS.map((type) => this.#choice(type)));
    log.addEventListener("event", (event) => this.#take(/** @type {CustomEvent} */ (event).detail));
  }

  /** @param {string} type */
  #choice(type) {
    const label = document.createElement("label");
    const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: this.#kinds.has(type) });
    box.addEventListener("change", () => this.#choose(type, box));
    label.className = "check";
    label.append(box, ` ${kind(type)}`);
    return label;
  }

  /** @param {string} kind @param {HTMLInputElement} box */
  async #choose(kind, box) {
    const problem = box.checked ? await refusal() : "";
    writeOrHide(this.problem, problem);
    if (problem !== "") box.checked = false;
    if (box.checked) this.#kinds.add(kind);
    else this.#kinds.delete(kind);
    remember({ notify: [...this.#kinds].join() });
  }

  /** @param {ServiceEvent} event */
  #take(event) {
    if (!this.#kinds.has(event.data.retracted_type ?? event.type) || globalThis.Notification?.permission !== "granted") return;
    if (this.#waiting.length === 0) setTimeout(() => this.#show(), COLLECT_MS);
    this.#waiting.push(event);
  }

  #show() {
    const events = this.#waiting.splice(0);
    if (events.length > MOST_AT_ONCE) notify(t("notify.many", { n: events.length }), sentence(events[0]), "dropanchor", window.focus);
    else for (const event of events) notify(sentence(event), clock(event), event.id, () => this.#open(event));
  }

  /** @param {ServiceEvent} event */
  #open(event) {
    window.focus();
    this.pick(event);
  }
}

/** @param {string} title @param {string} body @param {string} tag of which the browser shows one @param {() => void} open */
function notify(title, body, tag, open) {
  try {
    const shown = new Notification(title, { body, tag, icon: new URL("icon.svg", document.baseURI).href });
    shown.onclick = () => {
      shown.close();
      open();
    };
  } catch {
    // Browsers of phones show none for a page. The list of events has them.
  }
}

/** Ask for the permission. Return a sentence when there will be no notifications. */
async function refusal() {
  if (!isSecureContext) return t("notify.https");
  if (!("Notification" in window)) return t("notify.unsupported");
  return (await Notification.requestPermission()) === "granted" ? "" : t("notify.denied");
}
