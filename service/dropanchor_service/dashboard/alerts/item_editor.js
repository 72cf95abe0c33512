/** Edit a destination or a rule. Nothing changes for others until it is saved. */

import { ChangedMeanwhileError } from "../data/access.js";
import { newId } from "../zones/editor.js";
import { t } from "../i18n/language.js";
import { refusalInForm } from "../i18n/said.js";

/** @typedef {import("../data/items.js").Item} Item */

/** Event: "change". "saved" when something was saved or deleted. */
export class ItemEditor extends EventTarget {
  /** What is being edited. Its id is empty while it is new. @type {Item | null} */
  item = null;
  /** Why the last attempt to save failed. */
  problem = "";
  /** Whether somebody else has changed the item. */
  conflict = false;
  #etag = /** @type {string | null} */ (null);

  /** @param {import("../data/items.js").Items} items @param {() => readonly Item[]} known */
  constructor(items, known) {
    super();
    this.items = items;
    this.known = known;
  }

  get isNew() {
    return this.#etag === null;
  }

  /** @param {Record<string, any>} item without an id */
  begin(item) {
    this.#etag = null;
    this.item = { ...item, id: "" };
    this.#say("");
  }

  /** Edit an item as it is now. @param {string} id */
  async open(id) {
    try {
      const { item, etag } = await this.items.read(id);
      this.item = item;
      this.#etag = etag;
      this.#say("");
    } catch (error) {
      this.#say(refusalInForm(error));
    }
  }

  close() {
    this.item = null;
    this.#say("");
  }

  /** Save the item with these values. @param {Record<string, any>} values @param {string} name of which a new id is made */
  save(values, name) {
    const item = { .../** @type {Item} */ (this.item), ...values };
    item.id ||= newId(name, this.known());
    this.item = item;
    return this.#attempt(() => this.items.save(item, this.#etag), () => this.#etag === null && (item.id = ""));
  }

  remove() {
    return this.#attempt(() => this.items.remove(/** @type {Item} */ (this.item).id, this.#etag ?? ""), () => {});
  }

  /** @param {() => Promise<unknown>} send @param {() => void} undo */
  async #attempt(send, undo) {
    try {
      await send();
      this.close();
      this.dispatchEvent(new Event("saved"));
    } catch (error) {
      undo();
      this.#say(refusalInForm(error), error instanceof ChangedMeanwhileError);
    }
  }

  /** @param {string} problem @param {boolean} [conflict] */
  #say(problem, conflict = false) {
    this.problem = conflict ? t("zone.conflict") : problem;
    this.conflict = conflict;
    this.dispatchEvent(new Event("change"));
  }
}
