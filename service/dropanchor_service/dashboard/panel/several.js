/** What can be done with several selected tags: follow, compare, put into a group, export, clear. */

import { t } from "../i18n/language.js";
import { Comparison } from "./comparison.js";
import { TracksExport } from "./tracks_export.js";
import { MOST_SELECTED } from "../page/choice.js";
import { instead, partOf, write } from "../page/parts.js";

/** On a phone the table and the forms would cover the list. */
const NARROW = "(max-width: 800px)";

export class SeveralPanel {
  #isCompared = !matchMedia(NARROW).matches;

  /** @param {HTMLElement} panel @param {import("../data/fleet.js").Fleet} fleet @param {import("../data/roster.js").Roster} roster
   * @param {import("../page/choice.js").Choice} choice @param {import("../data/changes.js").Changes} changes @param {import("../page/past.js").Past} past
   * @param {() => void} leave selects none */
  constructor(panel, fleet, roster, choice, changes, past, leave) {
    this.panel = panel;
    this.fleet = fleet;
    this.choice = choice;
    this.changes = changes;
    this.past = past;
    this.comparison = new Comparison(/** @type {HTMLTableElement} */ (panel.querySelector("table")), fleet, roster, choice);
    this.group = /** @type {HTMLFormElement} */ (partOf(this.panel, "group"));
    this.tracks = new TracksExport(/** @type {HTMLFormElement} */ (partOf(this.panel, "export")), choice, past);
    /** @type {HTMLDetailsElement} */ (partOf(this.panel, "more")).open = this.#isCompared;
    partOf(this.panel, "follow-all").addEventListener("click", () => (choice.follow = !choice.follow));
    partOf(this.panel, "compare").addEventListener("click", () => this.#compare());
    partOf(this.panel, "close").addEventListener("click", leave);
    this.group.addEventListener("focusin", () => this.#offerGroups());
    instead(this.group, "submit", () => this.#putIntoGroup());
    choice.addEventListener("change", () => this.update());
    this.update();
  }

  update() {
    const { choice } = this;
    const tags = choice.several;
    this.panel.hidden = tags.length === 0;
    if (tags.length === 0) return;
    write(partOf(this.panel, "title"), t("several.selected", { n: tags.length }));
    write(partOf(this.panel, "note"), tags.length === MOST_SELECTED ? t("several.most", { n: MOST_SELECTED }) : choice.gathering ? t("several.gathering") : "");
    partOf(this.panel, "follow-all").setAttribute("aria-pressed", String(choice.follow));
    partOf(this.panel, "compare").setAttribute("aria-expanded", String(this.#isCompared));
    partOf(this.panel, "table").hidden = !this.#isCompared;
    this.group.hidden = !this.changes.mayWrite || this.past.active;
    this.tracks.update();
    if (this.#isCompared) this.comparison.update(tags);
  }

  #compare() {
    this.#isCompared = !this.#isCompared;
    this.update();
  }

  #offerGroups() {
    const groups = [...new Set(this.fleet.groups)].filter((group) => group !== "").sort();
    this.group.querySelector("datalist")?.replaceChildren(...groups.map((group) => new Option(group)));
  }

  async #putIntoGroup() {
    const field = /** @type {HTMLInputElement} */ (this.group.elements.namedItem("group"));
    const group = field.value.trim();
    const together = {}; // one Ctrl+Z undoes them all
    for (const tag of this.choice.several) {
      const path = `tags/${encodeURIComponent(tag)}/settings`;
      const label = this.fleet.labels[this.fleet.row(tag)] ?? tag;
      const what = t(group === "" ? "several.ungrouped" : "several.grouped", { tag: label, group });
      if (!(await this.changes.editAsIs(what, path, { group }, { together }))) return; // the page says why
    }
    field.value = "";
  }
}
