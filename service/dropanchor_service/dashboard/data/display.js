/** How a person wants to see the page: language and units. The address comes before what this browser remembers. */

import { addressValues } from "./address.js";

const KEY = "dropanchor-display";

/** @type {Storage | undefined} */
const storage = globalThis.window?.localStorage;

/** @returns {Record<string, string>} */
const remembered = () => JSON.parse(storage?.getItem(KEY) ?? "{}");

/**
 * Return what was chosen, or null when nothing allowed was.
 * @template {string} T @param {string} name as in the address @param {readonly T[] | null} allowed null: any value
 * @returns {T | null}
 */
export function chosen(name, allowed) {
  const values = [...addressValues().getAll(name).reverse(), remembered()[name]];
  const value = values.find((one) => one !== undefined && (allowed?.includes(/** @type {T} */ (one)) ?? true));
  return /** @type {T | undefined} */ (value) ?? null;
}

/** Remember choices for the next visit. @param {Record<string, string>} choices by name */
export function remember(choices) {
  storage?.setItem(KEY, JSON.stringify({ ...remembered(), ...choices }));
}
