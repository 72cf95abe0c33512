/** The list of rules, also of those that belong to zones. */

import { keepLines } from "./lines.js";
import { button, element } from "../page/elements.js";
import { ruleWords, zoneWords } from "./words.js";
import { t } from "../i18n/language.js";

export class RuleList {
  /** @param {HTMLElement} list @param {import("./alert_store.js").AlertStore} store @param {() => readonly import("../zones/zone_store.js").Zone[]} zones
   * @param {{edit: (id: string) => void, editZone: (id: string) => void}} act */
  constructor(list, store, zones, act) {
    this.list = list;
    this.store = store;
    this.zones = zones;
    this.act = act;
  }

  update() {
    const rules = this.store.allRules.map((rule) => ({ id: rule.id, name: rule.name || rule.id, words: ruleWords(rule), edit: this.act.edit }));
    const zones = this.zones().map((zone) => ({ id: zone.id, name: zone.name || zone.id, words: zoneWords(zone), edit: this.act.editZone }));
    keepLines(this.list, [...rules, ...zones.filter(({ words }) => words !== "")].map((entry) => ({
      key: JSON.stringify([entry, entry.edit === this.act.edit, this.store.mayWrite]), make: () => this.#line(entry),
    })));
  }

  /** @param {{id: string, name: string, words: string, edit: (id: string) => void}} entry */
  #line({ id, name, words, edit }) {
    const line = element("li", "");
    line.append(element("strong", name), element("span", words));
    if (this.store.mayWrite) {
      const row = element("div", "");
      row.append(button(t(edit === this.act.edit ? "zones.edit" : "rule.edit_zone"), t("zones.edit_one", { zone: name }), () => edit(id)));
      line.append(row);
    }
    return line;
  }
}
