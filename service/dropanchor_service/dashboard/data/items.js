/** Named items of the interface, such as zones and rules: read, saved and deleted with ETags. */

import { request, sendChange } from "./access.js";
import { api } from "./connection.js";

/** @typedef {Record<string, any> & {id: string}} Item as in the interface */

export class Items {
  /** @param {"destinations" | "event-rules" | "zones"} collection @param {(answer: any) => Item} itemOf takes the item from an answer */
  constructor(collection, itemOf) {
    this.collection = collection;
    this.itemOf = itemOf;
  }

  /** @param {string} id @param {string} [rest] of the path */
  url(id, rest = "") {
    return api(`${this.collection}/${encodeURIComponent(id)}${rest}`);
  }

  /** @param {string} id @returns {Promise<{item: Item, etag: string}>} */
  async read(id) {
    const response = await request(this.url(id), {});
    return { item: this.itemOf(await response.json()), etag: response.headers.get("etag") ?? "" };
  }

  /** Save an item. Throws as sendChange does. @param {Item} item @param {string | null} etag of the present one; null: it is new */
  save(item, etag) {
    return sendChange(this.url(item.id), "PUT", item, etag === null ? { "if-none-match": "*" } : { "if-match": etag });
  }

  /** Delete an item. Throws as sendChange does. @param {string} id @param {string} etag */
  remove(id, etag) {
    return sendChange(this.url(id), "DELETE", null, { "if-match": etag });
  }
}
