/** The form over the list of events: which ones, and what to do with them. */

import { timeOf } from "../data/time_zone.js";
import { t } from "../i18n/language.js";
import { fieldOf, partOf } from "../page/parts.js";
import { saveEvents } from "./found_events.js";
import { ALL_KINDS, kind } from "./words.js";

/** @typedef {import("./found_events.js").Wanted} Wanted */

export class EventFilter extends EventTarget {
  /** What the page shows of the past, if it does. @type {import("../data/periods.js").Period | null} */
  period = null;

  /** @param {HTMLFormElement} form @param {import("../data/fleet.js").Fleet} fleet @param {import("./zone_store.js").ZoneStore} zones */
  constructor(form, fleet, zones) {
    super();
    this.form = form;
    this.fleet = fleet;
    this.zones = zones;
    this.#list("type").append(...ALL_KINDS.map((one) => new Option(kind(one), one)));
    form.addEventListener("submit", (event) => event.preventDefault());
    form.addEventListener("change", () => this.dispatchEvent(new Event("change")));
    form.addEventListener("reset", () => queueMicrotask(() => this.dispatchEvent(new Event("change"))));
    for (const format of /** @type {const} */ (["csv", "jsonl"])) partOf(form, format).addEventListener("click", () => saveEvents(this.wanted, format));
    zones.addEventListener("change", () => this.#listZones());
  }

  /** Whether it leaves out any events. */
  get isActive() {
    return Object.values(this.wanted).some(Boolean);
  }

  /** @returns {Wanted} */
  get wanted() {
    const text = (/** @type {string} */ name) => fieldOf(this.form, name).value;
    const time = (/** @type {string} */ name) => (text(name) === "" ? null : timeOf(text(name)));
    return { tag: this.#tagCalled(text("tag").trim()), type: text("type"), zone: text("zone"), from_ms: this.period?.from_ms ?? time("from"), to_ms: this.period?.to_ms ?? time("to") };
  }

  /** Return the id of the tag with this name or id; the text itself where there is none. @param {string} text */
  #tagCalled(text) {
    const row = this.fleet.labels.findIndex((label, row) => [label, this.fleet.names[row]].some((name) => name.toLowerCase() === text.toLowerCase()));
    return row < 0 ? text : this.fleet.names[row];
  }

  #listZones() {
    const list = this.#list("zone");
    const options = [new Option(t("events.any_zone"), ""), ...this.zones.zones.map(({ id, name }) => new Option(name || id, id))];
    if (options.map(({ text, value }) => text + value).join("\n") === [...list.options].map(({ text, value }) => text + value).join("\n")) return;
    const { value } = list;
    list.replaceChildren(...options);
    list.value = value;
  }

  /** @param {string} name */
  #list(name) {
    return /** @type {HTMLSelectElement} */ (this.form.elements.namedItem(name));
  }

}
