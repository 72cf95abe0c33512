/** The list of zones: how many tags are in each, and a button that edits it. */

import { count, t } from "../i18n/language.js";
import { write } from "../page/parts.js";
import { button, line } from "../page/elements.js";

/** @typedef {import("./zone_store.js").Zone} Zone */

export class ZoneList {
  #shown = "";

  /** @param {HTMLElement} box @param {import("./zone_store.js").ZoneStore} store
   * @param {{select: (id: string) => void, edit: (id: string) => void, count: (id: string) => void}} act */
  constructor(box, store, act) {
    this.store = store;
    this.act = act;
    this.list = /** @type {HTMLElement} */ (box.querySelector("ul"));
    this.count = /** @type {HTMLElement} */ (box.querySelector('[data-part="count"]'));
    this.adding = /** @type {HTMLElement} */ (box.querySelector('[data-part="new"]'));
  }

  /** @param {boolean} current whether the counts are @param {string | null} selected id of a zone @param {boolean} editing */
  update(current, selected, editing) {
    const { zones, inside, mayWrite } = this.store;
    write(this.count, zones.length === 0 ? t("zones.none") : count(zones.length));
    this.adding.hidden = !mayWrite || editing;
    const shown = JSON.stringify([zones.map(({ id, name, colour }) => [id, name, colour]), mayWrite]);
    if (shown !== this.#shown) this.list.replaceChildren(...zones.map((zone) => this.#line(zone)));
    this.#shown = shown;
    zones.forEach(({ id }, i) => {
      const [choose, tags] = this.list.children[i].children;
      choose.setAttribute("aria-pressed", String(id === selected));
      const text = !current ? t("zones.outdated") : inside.has(id) ? t("zones.inside", { n: inside.get(id) }) : t("zones.empty");
      write(/** @type {HTMLElement} */ (tags), text);
      /** @type {HTMLButtonElement} */ (tags).disabled = !current || !inside.has(id);
    });
  }

  /** @param {Zone} zone */
  #line({ id, name, colour }) {
    const swatch = document.createElement("i");
    swatch.style.backgroundColor = colour;
    const choose = button(name || id, null, () => this.act.select(id), "choose");
    choose.prepend(swatch);
    const edit = this.store.mayWrite ? [button(t("zones.edit"), t("zones.edit_one", { zone: name || id }), () => this.act.edit(id))] : [];
    return line(choose, button("", null, () => this.act.count(id)), ...edit);
  }
}
