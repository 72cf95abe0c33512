/** The keys of the field that filters tags: arrows move in the list, Enter selects, Escape empties the field. */

import { t } from "../i18n/language.js";

const STEPS = ["ArrowDown", "ArrowUp", "PageDown", "PageUp"];

export class FilterKeys {
  /** The tag that the arrow keys have reached, while this field has the focus. */
  #reached = false;

  /** @param {HTMLInputElement} field @param {import("../panel/table.js").TagTable} table
   * @param {import("./choice.js").Choice} choice @param {(tag: string) => void} select @param {(text: string) => void} say */
  constructor(field, table, choice, select, say) {
    this.field = field;
    this.table = table;
    this.choice = choice;
    this.select = select;
    this.say = say;
    field.addEventListener("keydown", (event) => this.#onKey(event));
    for (const name of ["input", "blur"]) field.addEventListener(name, () => this.#reach(false));
  }

  /** @param {KeyboardEvent} event */
  #onKey(event) {
    if (event.isComposing || event.ctrlKey || event.metaKey || event.altKey) return;
    if (STEPS.includes(event.key)) {
      if (this.table.step(event)) this.#reach(true);
    } else if (event.key === "Enter") this.#enter();
    else if (event.key === "Escape" && this.field.value !== "") {
      this.field.value = this.choice.text = "";
      event.preventDefault();
      event.stopPropagation(); // a second Escape puts the tag away
    }
  }

  /** Select the tag that was reached, else the only one that is left, else the one that is called so. */
  #enter() {
    const { shown, active } = this.table;
    const only = shown.length === 1 ? shown[0] : this.table.called(this.choice.text);
    const tag = this.#reached && active ? active.tag : only;
    if (tag !== null) this.select(tag);
    else this.say(t(shown.length === 0 ? "find.none" : "find.several", { n: shown.length }));
  }

  /** Point screen readers at the row that the arrow keys have reached. @param {boolean} reached */
  #reach(reached) {
    this.#reached = reached;
    const row = reached ? this.table.active : null;
    this.table.box.classList.toggle("reached", row !== null);
    if (row) this.field.setAttribute("aria-activedescendant", row.id);
    else this.field.removeAttribute("aria-activedescendant");
  }
}
