/** The user's choices: the selected tags, whether the map follows them, and which tags are shown. */

import { STATES } from "../data/states.js";

/** More would fit neither an address nor a table that people compare. */
export const MOST_SELECTED = 300;

/** Colours of selected tags, which differ for people with any colour vision, on light and on dark. */
export const COLOURS = ["#2f7fd0", "#873df5", "#d65c8d", "#7c5e3c", "#e9470c"];

export class Choice extends EventTarget {
  /** @type {Map<string, string>} */
  #colours = new Map();
  /** @type {readonly string[]} */
  #tags = [];
  #gathering = false;
  #follow = false;
  #text = "";
  /** The words of the text, such as `zone:ramp`. @type {{key: string, word: string}[]} */
  #words = [];
  #only = "";
  #group = "";
  /** @type {Set<number>} */
  hiddenStates = new Set();

  /** @param {Record<string, (tag: string) => boolean>} kinds of tags that can be shown alone, by their names
   * @param {(tag: string) => readonly string[]} zonesOf the names of the zones in which a tag is */
  constructor(kinds = {}, zonesOf = () => []) {
    super();
    this.kinds = kinds;
    this.zonesOf = zonesOf;
  }

  /** The selected tag; null: none, or several. */
  get selected() {
    return this.several.length === 0 ? (this.#tags[0] ?? null) : null;
  }

  /** The selected tags when they are several; empty otherwise. */
  get several() {
    return this.#gathering || this.#tags.length > 1 ? this.#tags : [];
  }

  /** All selected tags: none, one or several. */
  get tags() {
    return this.#tags;
  }

  /** Whether each click or tap adds a tag to the selection or takes it out. */
  get gathering() {
    return this.#gathering;
  }

  /** Select one tag, or none. @param {string | null} tag */
  select(tag) {
    this.selectAll(tag === null ? [] : [tag]);
  }

  /** Select these tags and no other. @param {readonly string[]} tags
   * @param {boolean} [gathering] whether each click or tap adds one from now on */
  selectAll(tags, gathering = false) {
    this.#become([...new Set(tags)].slice(0, MOST_SELECTED), gathering);
  }

  /** Return the selected tags with one more, or without it if it is one of them. @param {string} tag */
  toggled(tag) {
    return this.#tags.includes(tag) ? this.#tags.filter((one) => one !== tag) : [...this.#tags, tag];
  }

  /** @param {readonly string[]} tags @param {boolean} gathering */
  #become(tags, gathering) {
    const isGathering = gathering && tags.length > 0;
    if (isGathering === this.#gathering && tags.join("\n") === this.#tags.join("\n")) return;
    [this.#tags, this.#gathering] = [tags, isGathering];
    this.#colour();
    if (tags.length === 0) this.#follow = false;
    this.#changed();
  }

  /** Give each selected tag a colour, which it keeps while it is selected. */
  #colour() {
    const kept = [...this.#colours].filter(([tag]) => this.#tags.includes(tag));
    const free = COLOURS.filter((one) => !kept.some(([, taken]) => taken === one));
    this.#colours = new Map(kept);
    for (const tag of this.#tags) {
      if (!this.#colours.has(tag)) this.#colours.set(tag, free.shift() ?? COLOURS[this.#colours.size % COLOURS.length]);
    }
  }

  /** Return the colour of a selected tag in the list, on the map and over time; empty: it is not selected. @param {string} tag */
  colourOf(tag) {
    return this.#colours.get(tag) ?? "";
  }

  get follow() {
    return this.#follow;
  }

  set follow(on) {
    const follow = on && this.#tags.length > 0;
    if (follow === this.#follow) return;
    this.#follow = follow;
    this.#changed();
  }

  get text() {
    return this.#text;
  }

  set text(text) {
    this.#read(text);
    this.#changed();
  }

  /** @param {string} text */
  #read(text) {
    this.#text = text.trim().toLowerCase();
    this.#words = this.#text.split(/\s+/).filter(Boolean).map((word) => {
      const [, key = "", rest = word] = /^(zone|floor|group):(.*)$/.exec(word) ?? [];
      return { key, word: rest };
    });
  }

  /** Return whether a word asks for something, such as a zone. @param {string} key */
  asksFor(key) {
    return this.#words.some((one) => one.key === key);
  }

  /** Show only the tags in a state; these, too, where only some are shown; without them, if they were. @param {number} state */
  chooseState(state) {
    if (this.hiddenStates.size === 0) this.hiddenStates = new Set(STATES.keys());
    if (!this.hiddenStates.delete(state)) this.hiddenStates.add(state);
    if (this.hiddenStates.size === STATES.length) this.hiddenStates.clear();
    this.#changed();
  }

  /** The kind of tags that are shown alone, such as those that need care; empty: all are. */
  get only() {
    return this.#only;
  }

  set only(kind) {
    this.#only = kind;
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
    this.filter({ text: "", group: "", only: "", hidden: [] });
  }

  /** Set the whole filter. @param {{text: string, group: string, only: string, hidden: number[]}} filter hidden: states */
  filter({ text, group, only, hidden }) {
    this.#read(text);
    this.#group = group;
    this.#only = only;
    this.hiddenStates = new Set(hidden);
    this.#changed();
  }

  get isFiltered() {
    return this.#text !== "" || this.#group !== "" || this.#only !== "" || this.hiddenStates.size > 0;
  }

  /** @param {import("../data/fleet.js").Fleet} fleet @param {number} row */
  shows(fleet, row) {
    if (this.hiddenStates.size > 0 && this.hiddenStates.has(fleet.state[row])) return false;
    if (this.#only !== "" && !this.kinds[this.#only]?.(fleet.names[row])) return false;
    if (this.#group !== "" && fleet.groups[row] !== this.#group) return false;
    return this.#words.every((word) => this.#matches(fleet, row, word));
  }

  /** @param {import("../data/fleet.js").Fleet} fleet @param {number} row @param {{key: string, word: string}} word */
  #matches(fleet, row, { key, word }) {
    if (key === "zone") return this.zonesOf(fleet.names[row]).some((zone) => zone.toLowerCase().includes(word));
    if (key === "floor") return (fleet.value.floor[row] ?? "").toLowerCase().includes(word);
    if (key === "group") return fleet.groups[row].toLowerCase().includes(word);
    const { name, label } = STATES[fleet.state[row]];
    return name === word || label.toLowerCase() === word || `${fleet.labels[row]}\n${fleet.names[row]}`.toLowerCase().includes(word);
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
