/** The panel of the anchors: a list, and a form for the one that is being edited. */

import { wayBetween } from "./anchors.js";
import { distance, place3 } from "../data/format.js";
import { t } from "../i18n/language.js";
import { nameKey } from "../data/order.js";
import { readMeasure, writeMeasure } from "../data/units.js";
import { confirmed } from "./confirm.js";
import { fieldOf, instead, partOf } from "../page/parts.js";
import { button, line } from "../page/elements.js";

const FIELDS = /** @type {const} */ (["x", "y", "z"]);

export class AnchorPanel {
  /** @param {HTMLElement} panel @param {HTMLButtonElement} toggle @param {HTMLDialogElement} dialog
   * @param {import("./anchors.js").AnchorEditor} editor @param {import("../data/changes.js").Changes} changes
   * @param {import("../page/one_panel.js").Panels} panels @param {import("../data/fleet.js").Fleet} fleet */
  constructor(panel, toggle, dialog, editor, changes, panels, fleet) {
    this.panel = panel;
    this.toggle = toggle;
    this.editor = editor;
    this.changes = changes;
    this.dialog = dialog;
    this.panels = panels;
    this.fleet = fleet;
    this.list = partOf(this.panel, "list");
    this.form = /** @type {HTMLFormElement} */ (partOf(this.panel, "form"));
    panels.add("anchors", { isOpen: () => editor.isOpen, isUnsaved: () => editor.isUnsaved, leave: () => editor.close() });
    editor.choose = (id) => panels.open("anchors", () => editor.select(id));
    toggle.addEventListener("click", () => panels.toggle("anchors", () => editor.open()));
    partOf(this.panel, "close").addEventListener("click", () => panels.close("anchors"));
    partOf(this.panel, "new").addEventListener("click", () => this.add());
    partOf(this.panel, "delete").addEventListener("click", () => this.#delete());
    this.form.addEventListener("input", () => this.#typed());
    instead(this.form, "submit", () => editor.save());
    instead(this.form, "reset", () => editor.cancel());
    this.list.addEventListener("click", (event) => {
      const id = /** @type {HTMLElement} */ (event.target).closest("button")?.dataset.anchor;
      if (id !== undefined && id !== editor.draft?.id) editor.choose(id);
    });
    for (const source of [editor, changes]) for (const name of ["change", "access"]) source.addEventListener(name, () => this.#update());
    this.#update();
  }

  /** Begin a new anchor. @param {string} [id] @param {{x: number, y: number}} [place] m */
  add(id, place) {
    this.panels.open("anchors", () => {
      this.editor.add(id, place);
      fieldOf(this.form, id ? "x" : "id").select();
    });
  }

  #update() {
    const { editor, changes } = this;
    const { draft } = editor;
    this.toggle.hidden = !changes.mayWrite;
    this.toggle.setAttribute("aria-pressed", String(editor.isOpen));
    this.panel.hidden = !editor.isOpen;
    this.#fillList();
    this.form.hidden = draft === null;
    partOf(this.panel, "delete").hidden = editor.isNew || !changes.mayDelete;
    const { origin } = editor;
    partOf(this.panel, "save").textContent = t(editor.isNew ? "anchors.add_new" : origin ? "anchors.move" : "save");
    partOf(this.panel, "moves").textContent = draft && origin ? this.#question(origin, draft) : "";
    fieldOf(this.form, "id").readOnly = !editor.isNew;
    if (!draft) return;
    if (fieldOf(this.form, "id").value !== draft.id) fieldOf(this.form, "id").value = draft.id;
    for (const name of FIELDS) writeMeasure(fieldOf(this.form, name), draft[name]);
  }

  /** @param {import("./anchors.js").Anchor} from @param {import("./anchors.js").Anchor} to */
  #question(from, to) {
    const n = this.fleet.value.anchor.filter((anchor, row) => anchor === from.id && this.fleet.hasPose(row)).length;
    return t("anchors.move_question", { id: from.id, way: distance(wayBetween(from, to), 3), n });
  }

  #fillList() {
    const { draft, isNew } = this.editor;
    const anchors = [...this.editor.anchors].sort((a, b) => (nameKey(a.id) < nameKey(b.id) ? -1 : 1));
    const texts = anchors.map(({ id, x, y, z }) => t("anchors.line", { id, place: place3(x, y, z) }));
    const shown = JSON.stringify([texts, draft?.id, isNew]);
    if (this.list.dataset.shown === shown) return;
    this.list.dataset.shown = shown;
    const focused = /** @type {HTMLElement | null} */ (document.activeElement)?.dataset.anchor;
    this.list.replaceChildren(...anchors.map(({ id }, i) => {
      const choose = button(texts[i], null, () => {}, "");
      choose.dataset.anchor = id;
      choose.setAttribute("aria-pressed", String(!isNew && id === draft?.id));
      return line(choose);
    }));
    for (const button of this.list.querySelectorAll("button")) if (button.dataset.anchor === focused) button.focus();
  }

  #typed() {
    const values = Object.fromEntries(FIELDS.map((name) => [name, readMeasure(fieldOf(this.form, name))]));
    if (FIELDS.some((name) => values[name] === null)) return; // the form says what is missing when it is sent
    this.editor.change({ id: fieldOf(this.form, "id").value, ...values });
  }

  async #delete() {
    const question = t("anchors.delete_question", { id: this.editor.draft?.id });
    if (await confirmed(this.dialog, question, t("delete"))) await this.editor.remove();
  }
}
