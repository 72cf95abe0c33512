/** Named items of the interface, such as zones and rules: where they are, and reading one with its ETag. */

import { request } from "./access.js";
import { api } from "./connection.js";

/** @typedef {Record<string, any> & {id: string}} Item as in the interface */

export class Items {
  /** @param {"destinations" | "event-rules" | "zones"} collection @param {(answer: any) => Item} itemOf takes the item from an answer */
  constructor(collection, itemOf) {
    this.collection = collection;
    this.itemOf = itemOf;
  }

  /** @param {string} id */
  path(id) {
    return `${this.collection}/${encodeURIComponent(id)}`;
  }

  /** @param {string} id @param {string} [rest] of the path */
  url(id, rest = "") {
    return api(this.path(id) + rest);
  }

  /** @param {string} id @returns {Promise<import("./changes.js").Seen>} */
  async read(id) {
    const response = await request(this.url(id), {});
    return { value: this.itemOf(await response.json()), etag: response.headers.get("etag") ?? "" };
  }
}
