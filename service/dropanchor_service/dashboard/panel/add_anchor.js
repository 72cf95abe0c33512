/** Offer to add an anchor that the selected tag hears and the site lacks. */

import { t } from "../i18n/language.js";

export class AddAnchor {
  /** @param {HTMLElement} panel @param {import("../data/roster.js").Roster} roster
   * @param {import("../page/choice.js").Choice} choice @param {import("../data/changes.js").Changes} changes
   * @param {(id: string) => void} add */
  constructor(panel, roster, choice, changes, add) {
    this.roster = roster;
    this.choice = choice;
    this.changes = changes;
    this.offer = /** @type {HTMLButtonElement} */ (panel.querySelector('[data-part="add-anchor"]'));
    this.offer.addEventListener("click", () => add(this.offer.dataset.anchor ?? ""));
  }

  update() {
    const { selected } = this.choice;
    const missing = selected === null ? null : (this.roster.of(selected)?.unknown_anchor ?? null);
    this.offer.hidden = missing === null || !this.changes.mayWrite;
    if (missing !== null && this.offer.dataset.anchor !== missing) {
      this.offer.dataset.anchor = missing;
      this.offer.textContent = t("tag.add_anchor", { id: missing });
    }
  }
}
