/** Edit a destination or a rule. Nothing changes for others until it is saved. */

import { ChangedMeanwhileError, NetworkRefusedError } from "../data/access.js";
import { Saving } from "../data/saving.js";
import { UNDO_MS } from "../data/undo.js";
import { newId } from "../zones/editor.js";
import { t } from "../i18n/language.js";
import { refusalInForm } from "../i18n/said.js";

/** @typedef {import("../data/items.js").Item} Item */

/** What others see of an item that is not saved yet. */
const NEW = { value: null, etag: "" };

/** Return why a change cannot be undone, because nobody can read what was there before; empty: it can.
 * @param {Item} before as answers have it @param {Item} after */
export function unreadable(before, after) {
  const isHidden = after.secret || (before.url?.endsWith("/…") && after.url !== before.url);
  return isHidden ? t("destination.not_undone") : "";
}

/** Event: "change". */
export class ItemEditor extends EventTarget {
  /** What is being edited. Its id is empty while it is new. @type {Item | null} */
  item = null;
  /** Whether a person has typed something. */
  isUnsaved = false;
  saving = new Saving();
  /** Why the last attempt to save failed. */
  problem = "";
  /** Whether somebody else has changed the item. */
  conflict = false;
  /** The item as it is for others. @type {import("../data/changes.js").Seen} */
  #seen = NEW;
  /** The network that an administrator can allow, so that it can be saved. @type {string | null} */
  network = null;

  /** @param {"rule" | "destination"} kind in names of messages @param {import("../data/items.js").Items} items
   * @param {() => readonly Item[]} known @param {import("../data/changes.js").Changes} changes */
  constructor(kind, items, known, changes) {
    super();
    this.kind = kind;
    this.items = items;
    this.known = known;
    this.changes = changes;
  }

  get isNew() {
    return this.#seen.value === null;
  }

  /** @param {Record<string, any>} item without an id */
  begin(item) {
    this.#seen = NEW;
    this.#show({ ...item, id: "" });
  }

  /** Edit an item as it is now. @param {string} id */
  async open(id) {
    try {
      this.#seen = await this.items.read(id);
      this.#show(this.#seen.value);
    } catch (error) {
      this.#say(refusalInForm(error));
    }
  }

  close() {
    this.#show(null);
  }

  /** Save the item with these values. @param {Record<string, any>} values @param {string} name of which a new id is made */
  save(values, name) {
    const item = { .../** @type {Item} */ (this.item), ...values };
    item.id ||= newId(name, this.known());
    this.item = item;
    const refusal = this.isNew ? "" : unreadable(this.#seen.value, item);
    return this.#attempt(() => this.#apply(this.isNew ? "added" : "changed", item, refusal), () => this.isNew && (item.id = ""));
  }

  /** Delete the item. That of a destination waits: nobody could bring back its secret and its queue. */
  remove() {
    if (this.kind === "rule") return this.#attempt(() => this.#apply("deleted", null), () => {});
    const { id } = /** @type {Item} */ (this.item);
    this.changes.removeLater(t("destination.deleted", { item: id }), this.items.path(id), this.#seen.etag, t("destination.until_then", { seconds: UNDO_MS / 1000 }));
    return this.close();
  }

  /** @param {"added" | "changed" | "deleted"} what @param {Item | null} item null: delete it
   * @param {string} [refusal] why it cannot be undone */
  #apply(what, item, refusal) {
    const { id, name } = item ?? this.#seen.value;
    return this.changes.apply(t(`${this.kind}.${what}`, { item: name || id }), this.items.path(id), this.#seen, item, refusal ? { refusal } : {});
  }

  /** @param {() => Promise<unknown>} send @param {() => void} undo */
  #attempt(send, undo) {
    return this.saving.until(this.#send(send, undo));
  }

  /** @param {() => Promise<unknown>} send @param {() => void} undo */
  async #send(send, undo) {
    try {
      await send();
      this.close();
    } catch (error) {
      undo();
      const network = error instanceof NetworkRefusedError ? error.network : null;
      this.#say(network === null ? refusalInForm(error) : t("networks.refused", { network }), error instanceof ChangedMeanwhileError, network);
    }
  }

  /** @param {Item | null} item */
  #show(item) {
    this.item = item;
    this.isUnsaved = false;
    this.#say("");
  }

  /** @param {string} problem @param {boolean} [conflict] @param {string | null} [network] */
  #say(problem, conflict = false, network = null) {
    this.network = network;
    this.problem = conflict ? t("zone.conflict") : problem;
    this.conflict = conflict;
    this.dispatchEvent(new Event("change"));
  }
}
