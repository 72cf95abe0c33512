/** Who is in which zone, those first that have been there longest, and who is in none: to look at, and to print. */

import { age } from "../data/format.js";
import { api, getJson } from "../data/connection.js";
import { t } from "../i18n/language.js";

/** @typedef {{tag: string, since_ns: number}} Occupant */
/** @typedef {{title: string, zone: string | null, tags: {tag: string, note: string}[]}} Group zone: null for all others */

export class Headcount {
  /** @param {HTMLDialogElement} dialog @param {import("./zone_store.js").ZoneStore} store @param {import("../data/fleet.js").Fleet} fleet
   * @param {(tag: string) => void} selectTag */
  constructor(dialog, store, fleet, selectTag) {
    this.dialog = dialog;
    this.store = store;
    this.fleet = fleet;
    this.selectTag = selectTag;
    this.part("print").addEventListener("click", () => print());
    this.part("close").addEventListener("click", () => dialog.close());
    store.addEventListener("change", () => dialog.open && this.#update());
  }

  /** @param {string} name @returns {HTMLElement} */
  part(name) {
    return /** @type {HTMLElement} */ (this.dialog.querySelector(`[data-part="${name}"]`));
  }

  /** Show the list, from this zone on if one is named. @param {string | null} zone */
  async open(zone) {
    await this.#update();
    this.dialog.showModal();
    if (zone !== null) this.dialog.querySelector(`[data-zone="${CSS.escape(zone)}"]`)?.scrollIntoView({ block: "start" });
  }

  async #update() {
    const answer = await getJson(api("zone-occupancy?names=true")).catch(() => null);
    this.part("when").textContent = answer ? new Date().toLocaleString(document.documentElement.lang) : t("zones.outdated");
    if (answer) this.part("groups").replaceChildren(...this.#groups(answer.zones).map((group) => this.#section(group)));
  }

  /** @param {{zone: string, inside: Occupant[]}[]} occupied @returns {Group[]} */
  #groups(occupied) {
    const { fleet } = this;
    const inside = new Map(occupied.map((one) => [one.zone, one.inside]));
    const groups = this.store.zones.map(({ id, name }) => ({
      title: name || id, zone: id,
      tags: (inside.get(id) ?? []).map(({ tag, since_ns }) => ({ tag, note: age(Date.now() / 1e3 - since_ns / 1e9) })),
    }));
    const known = new Set(occupied.flatMap((one) => one.inside.map(({ tag }) => tag)));
    const others = fleet.names.filter((tag) => !known.has(tag)).sort().map((tag) => ({ tag, note: "" }));
    return [...groups, { title: t("headcount.others"), zone: null, tags: others }];
  }

  /** @param {Group} group */
  #section({ title, zone, tags }) {
    const section = document.createElement("section");
    if (zone !== null) section.dataset.zone = zone;
    const heading = Object.assign(document.createElement("h3"), { textContent: t("headcount.zone", { zone: title, n: tags.length }) });
    const list = document.createElement("ul");
    list.append(...tags.map(({ tag, note }) => this.#line(tag, note)));
    section.append(heading, list);
    return section;
  }

  /** @param {string} tag @param {string} note since when it is there */
  #line(tag, note) {
    const row = this.fleet.row(tag);
    const state = row < 0 ? null : this.fleet.style(row);
    const button = Object.assign(document.createElement("button"), { type: "button", className: "text", textContent: this.fleet.labels[row] ?? tag });
    button.addEventListener("click", () => {
      this.dialog.close();
      this.selectTag(tag);
    });
    const line = document.createElement("li");
    line.append(button, " ", [note, state?.trusted ? "" : (state?.label ?? "")].filter(Boolean).join(" · "));
    return line;
  }
}
