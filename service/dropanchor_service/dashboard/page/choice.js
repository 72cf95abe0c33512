/** The user's choices: the selected tag, whether the map follows it, and which tags are shown. */

import { STATES } from "../data/states.js";

export class Choice extends EventTarget {
  /** @type {string | null} */
  #selected = null;
  #follow = false;
  #text = "";
  #onlyCare = false;
  #group = "";
  /** @type {Set<number>} */
  hiddenStates = new Set();

  /** @param {(tag: string) => boolean} needsCare */
  constructor(needsCare = () => false) {
    super();
    this.needsCare = needsCare;
  }

  get selected() {
    return this.#selected;
  }

  /** @param {string | null} tag */
  select(tag) {
    if (tag === this.#selected) return;
    this.#selected = tag;
    if (tag === null) this.#follow = false;
    this.#changed();
  }

  get follow() {
    return this.#follow;
  }

  set follow(on) {
    const follow = on && this.#selected !== null;
    if (follow === this.#follow) return;
    this.#follow = follow;
    this.#changed();
  }

  get text() {
    return this.#text;
  }

  set text(text) {
    this.#text = text.trim().toLowerCase();
    this.#changed();
  }

  /** @param {number} state */
  toggleState(state) {
    if (!this.hiddenStates.delete(state)) this.hiddenStates.add(state);
    this.#changed();
  }

  /** Whether only tags that need care are shown. */
  get onlyCare() {
    return this.#onlyCare;
  }

  set onlyCare(only) {
    this.#onlyCare = only;
    this.#changed();
  }

  /** The group that is shown; empty: all tags. */
  get group() {
    return this.#group;
  }

  set group(group) {
    this.#group = group;
    this.#changed();
  }

  showAll() {
    this.filter({ text: "", group: "", onlyCare: false, hidden: [] });
  }

  /** Set the whole filter. @param {{text: string, group: string, onlyCare: boolean, hidden: number[]}} filter hidden: states */
  filter({ text, group, onlyCare, hidden }) {
    this.#text = text.trim().toLowerCase();
    this.#group = group;
    this.#onlyCare = onlyCare;
    this.hiddenStates = new Set(hidden);
    this.#changed();
  }

  get isFiltered() {
    return this.#text !== "" || this.#group !== "" || this.#onlyCare || this.hiddenStates.size > 0;
  }

  /** @param {import("../data/fleet.js").Fleet} fleet @param {number} row */
  shows(fleet, row) {
    if (this.hiddenStates.size > 0 && this.hiddenStates.has(fleet.state[row])) return false;
    if (this.#onlyCare && !this.needsCare(fleet.names[row])) return false;
    if (this.#group !== "" && fleet.groups[row] !== this.#group) return false;
    return this.#text === "" || `${fleet.labels[row]}\n${fleet.names[row]}`.toLowerCase().includes(this.#text);
  }

  #changed() {
    this.dispatchEvent(new Event("change"));
  }
}

/** Return the number of tags in each state. @param {import("../data/fleet.js").Fleet} fleet @returns {number[]} */
export function countStates(fleet) {
  const counts = STATES.map(() => 0);
  for (let row = 0; row < fleet.size; row++) counts[fleet.state[row]]++;
  return counts;
}
