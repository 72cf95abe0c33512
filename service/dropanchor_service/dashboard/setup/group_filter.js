/** A list of the groups, of which one can be shown alone. */

import { t } from "../i18n/language.js";

export class GroupFilter {
  /** The chosen group, once a tag has it: until then it may be that of a link. */
  #known = "";

  /** @param {HTMLSelectElement} select @param {import("../data/fleet.js").Fleet} fleet @param {import("../page/choice.js").Choice} choice */
  constructor(select, fleet, choice) {
    this.select = select;
    this.fleet = fleet;
    this.choice = choice;
    select.addEventListener("change", () => (choice.group = select.value));
    choice.addEventListener("change", () => this.update());
  }

  update() {
    const groups = [...new Set(this.fleet.groups)].filter((group) => group !== "").sort();
    const shown = JSON.stringify(groups);
    if (groups.includes(this.choice.group)) this.#known = this.choice.group;
    else if (this.choice.group !== "" && this.choice.group === this.#known) this.choice.group = "";
    if (this.select.dataset.shown !== shown) {
      this.select.dataset.shown = shown;
      this.select.replaceChildren(new Option(t("tags.all_groups"), ""), ...groups.map((group) => new Option(group)));
    }
    this.select.value = this.choice.group;
    this.select.hidden = groups.length === 0;
  }
}
