/** The form of a destination or a rule. Fields with `data-for` belong to some types only. */

import { fill, valueOf } from "../page/model_fields.js";
import { instead, partOf, writeOrHide } from "../page/parts.js";

/** @typedef {import("../data/items.js").Item} Item @typedef {import("../page/model_fields.js").Field} Field */

export class ItemForm {
  /** What is shown, so that what is being typed is not overwritten. @type {Item | null} */
  #shown = null;

  /** @param {HTMLFormElement} form @param {import("./item_editor.js").ItemEditor} editor
   * @param {{title: (item: Item, isNew: boolean) => string, mayDelete: () => boolean, ask: () => Promise<boolean>}} act */
  constructor(form, editor, act) {
    this.form = form;
    this.editor = editor;
    this.act = act;
    instead(form, "submit", () => editor.save(this.#values(), this.#named()));
    form.addEventListener("reset", () => editor.close());
    form.addEventListener("input", () => (editor.isUnsaved = true));
    partOf(this.form, "newer").addEventListener("click", () => editor.item && editor.open(editor.item.id));
    partOf(this.form, "delete").addEventListener("click", async () => (await act.ask()) && editor.remove());
    editor.addEventListener("change", () => this.#update());
  }

  #update() {
    const { item, isNew, problem, conflict } = this.editor;
    this.form.hidden = item === null;
    writeOrHide(partOf(this.form, "problem"), problem);
    partOf(this.form, "newer").hidden = !conflict;
    partOf(this.form, "delete").hidden = isNew || !this.act.mayDelete();
    if (problem !== "") partOf(this.form, "problem").scrollIntoView({ block: "nearest" });
    if (item !== null && problem === "" && item !== this.#shown) this.#show(item, isNew);
    this.#shown = item;
  }

  /** @param {Item} item @param {boolean} isNew */
  #show(item, isNew) {
    writeOrHide(partOf(this.form, "title"), this.act.title(item, isNew));
    for (const part of /** @type {NodeListOf<HTMLElement>} */ (this.form.querySelectorAll("[data-for]"))) {
      part.hidden = !(part.dataset.for ?? "").split(" ").includes(item.type) || (part.dataset.new !== undefined && !isNew);
    }
    for (const field of this.#fields()) {
      field.disabled = field.closest("[hidden]:not(form)") !== null;
      if (!field.disabled) fill(field, item[field.name]);
    }
    this.#fields().find((field) => !field.disabled)?.focus();
  }

  #fields() {
    return /** @type {Field[]} */ ([...this.form.querySelectorAll("input, select, textarea")]);
  }

  #values() {
    /** @type {Record<string, any>} */
    const values = {};
    for (const field of this.#fields()) {
      if (field.disabled || field.dataset.as === "id") continue;
      if (field.dataset.as === "choice") values[field.name] = [...(values[field.name] ?? []), .../** @type {HTMLInputElement} */ (field).checked ? [field.value] : []];
      else values[field.name] = valueOf(field);
    }
    return values;
  }

  /** Return the text of which a new id is made. */
  #named() {
    return this.#fields().find((field) => field.dataset.as === "id" || field.name === "name")?.value ?? "";
  }
}
