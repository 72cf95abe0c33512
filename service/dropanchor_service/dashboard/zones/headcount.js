/** Who is in which zone, those first that have been there longest, and who is in none: to look at, and to print. */

import { api, getJson } from "../data/connection.js";
import { partOf, write } from "../page/parts.js";
import { clock } from "./words.js";
import { t, timeText } from "../i18n/language.js";
import { button, line } from "../page/elements.js";

/** @typedef {{tag: string, since_ns: number}} Occupant */
/** @typedef {{tag: string, label: string, note: string}} Line note: since when it is there, and its state unless that is good */
/** @typedef {{title: string, zone: string | null, tags: Line[]}} Group zone: null for all others */

export class Headcount {
  #shown = ""; // a line with the focus keeps it while nothing changes

  /** @param {HTMLDialogElement} dialog @param {import("./zone_store.js").ZoneStore} store @param {import("../data/fleet.js").Fleet} fleet
   * @param {(tag: string) => void} selectTag */
  constructor(dialog, store, fleet, selectTag) {
    this.dialog = dialog;
    this.store = store;
    this.fleet = fleet;
    this.selectTag = selectTag;
    partOf(dialog, "print").addEventListener("click", () => print());
    partOf(dialog, "close").addEventListener("click", () => dialog.close());
    store.addEventListener("change", () => dialog.open && this.#update());
  }

  /** Show the list, from this zone on if one is named. @param {string | null} zone */
  async open(zone) {
    await this.#update();
    this.dialog.showModal();
    if (zone !== null) this.dialog.querySelector(`[data-zone="${CSS.escape(zone)}"]`)?.scrollIntoView({ block: "start" });
  }

  async #update() {
    const answer = await getJson(api("zone-occupancy?names=true")).catch(() => null);
    write(partOf(this.dialog, "when"), answer ? timeText(Date.now(), { dateStyle: "full", timeStyle: "long" }) : t("zones.outdated"));
    const groups = /** @type {Group[] | null} */ (answer && this.#groups(answer.zones));
    const shown = JSON.stringify(groups);
    if (groups && shown !== this.#shown) partOf(this.dialog, "groups").replaceChildren(...groups.map((group) => this.#section(group)));
    this.#shown = shown;
  }

  /** @param {{zone: string, inside: Occupant[]}[]} occupied @returns {Group[]} */
  #groups(occupied) {
    const { fleet } = this;
    const inside = new Map(occupied.map((one) => [one.zone, one.inside]));
    const groups = this.store.zones.map(({ id, name }) => ({
      title: name || id, zone: id,
      tags: (inside.get(id) ?? []).map(({ tag, since_ns }) => this.#line(tag, t("headcount.since", { time: clock({ time: since_ns / 1e6 }) }))),
    }));
    const known = new Set(occupied.flatMap((one) => one.inside.map(({ tag }) => tag)));
    const others = fleet.names.filter((tag) => !known.has(tag)).sort().map((tag) => this.#line(tag));
    return [...groups, { title: t("headcount.others"), zone: null, tags: others }];
  }

  /** @param {Group} group */
  #section({ title, zone, tags }) {
    const section = document.createElement("section");
    if (zone !== null) section.dataset.zone = zone;
    const heading = Object.assign(document.createElement("h3"), { textContent: t("headcount.zone", { zone: title, n: tags.length }) });
    const list = document.createElement("ul");
    list.append(...tags.map((line) => this.#item(line)));
    section.append(heading, list);
    return section;
  }

  /** Return what is known of a tag. @param {string} tag @param {string} [since] @returns {Line} */
  #line(tag, since = "") {
    const row = this.fleet.row(tag);
    const state = row < 0 ? null : this.fleet.style(row);
    return { tag, label: this.fleet.labels[row] ?? tag, note: [since, state?.trusted ? "" : state?.label].filter(Boolean).join(" · ") };
  }

  /** @param {Line} line */
  #item({ tag, label, note }) {
    const choose = button(label, null, () => {
      this.dialog.close();
      this.selectTag(tag);
    });
    return line(choose, " ", note);
  }
}
