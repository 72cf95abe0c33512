/** Filter and sort the tags for the table. */

import { BEST_FIRST, STATES, stateNumber } from "./states.js";

/** @typedef {import("./fleet.js").Fleet} Fleet */
/** @typedef {{column: string, descending: boolean}} Sort */

/** How much trouble a tag is in by its state; none for other states. */
const TROUBLE = new Map([[stateNumber("degraded"), 1], [stateNumber("lost"), 2]]);
const RANK_OF = STATES.map((_, state) => BEST_FIRST.indexOf(state));

/** Return a sort key that puts `tag-9` before `tag-10`. @param {string} name */
export const nameKey = (name) => name.toLowerCase().replace(/\d+/g, (digits) => digits.padStart(12, "0"));

export class Order {
  #membership = -1;
  /** The rows in the order of their names. @type {number[]} */
  #byName = [];
  /** The place of each row in that order. */
  #place = new Int32Array(0);

  /**
   * Return the sorted rows. Unknown values come last in both directions, and equal values are sorted by name.
   * By name, tags in trouble come first: with alarms, then lost, then degraded ones.
   * @param {Fleet} fleet @param {(row: number) => boolean} wanted @param {Sort} sort @param {number} now_ms
   * @param {(tag: string) => number} [alarmOf] 2: alarm, 1: warning, 0: neither
   * @param {(column: string, now_ms: number) => ((row: number) => number) | null} [valueOfMore] of columns that are not of the fleet
   */
  rows(fleet, wanted, sort, now_ms, alarmOf = () => 0, valueOfMore = () => null) {
    this.#sortNames(fleet);
    const rows = this.#byName.filter(wanted);
    const sign = sort.descending ? -1 : 1;
    const value = valueOf(fleet, sort.column, now_ms) ?? valueOfMore(sort.column, now_ms);
    if (!value) return troubledFirst(sort.descending ? rows.reverse() : rows, (row) => 3 * alarmOf(fleet.names[row]) + (TROUBLE.get(fleet.state[row]) ?? 0));
    const values = Float64Array.from({ length: fleet.size }, (_, row) => value(row));
    return rows.sort((a, b) => compare(values[a], values[b], sign) || this.#place[a] - this.#place[b]);
  }

  /** Sort the names when tags have come or gone, since that takes long for ten thousand. @param {Fleet} fleet */
  #sortNames(fleet) {
    if (fleet.membership === this.#membership) return;
    this.#membership = fleet.membership;
    const keys = fleet.labels.map(nameKey);
    this.#byName = keys.map((_, row) => row).sort((a, b) => (keys[a] < keys[b] ? -1 : keys[a] > keys[b] ? 1 : a - b));
    this.#place = new Int32Array(fleet.size);
    this.#byName.forEach((row, place) => (this.#place[row] = place));
  }
}

/** Return the rows with those first that are in the most trouble, and otherwise in the same order.
 * @param {number[]} rows @param {(row: number) => number} trouble */
function troubledFirst(rows, trouble) {
  /** @type {number[][]} */
  const groups = [];
  for (const row of rows) (groups[trouble(row)] ??= []).push(row);
  return groups.reverse().flat();
}

/** @param {number} a @param {number} b @param {number} sign */
function compare(a, b, sign) {
  if (Number.isNaN(a) || Number.isNaN(b)) return Number(Number.isNaN(a)) - Number(Number.isNaN(b));
  return sign * (a - b);
}

/** @param {Fleet} fleet @param {string} column @param {number} now_ms @returns {((row: number) => number) | null} */
function valueOf(fleet, column, now_ms) {
  const { x, y, semi_major_m: half, speed_mps: speed } = fleet.number;
  /** @type {Record<string, (row: number) => number>} */
  const values = {
    state: (row) => RANK_OF[fleet.state[row]],
    x: (row) => x[row],
    y: (row) => y[row],
    accuracy: (row) => half[row],
    speed: (row) => speed[row],
    age: (row) => fleet.age(row, now_ms),
    online: (row) => 1 - fleet.online[row],
  };
  return values[column] ?? null;
}
