/** What the page shows, in its address: tag, part of the map, and filter. A copied link shows the same. */

import { addressValues, writeAddress } from "../data/address.js";
import { STATES } from "../data/states.js";

const WRITE_MS = 500;

export class ViewAddress {
  #wroteAt = -Infinity;

  /** @param {import("./choice.js").Choice} choice @param {import("../map/map.js").LiveMap} map @param {HTMLInputElement} filter */
  constructor(choice, map, filter) {
    this.choice = choice;
    this.map = map;
    this.filter = filter;
    addEventListener("hashchange", () => this.read());
    this.read();
  }

  /** Show what the address says. */
  read() {
    const { choice, filter } = this;
    const values = addressValues();
    const hidden = (values.get("hide") ?? "").split(",");
    filter.value = values.get("text") ?? "";
    choice.filter({
      text: filter.value, group: values.get("group") ?? "", onlyCare: values.has("care"),
      hidden: STATES.flatMap(({ name }, number) => (hidden.includes(name) ? [number] : [])),
    });
    choice.select(values.get("tag"));
    this.#readView(values);
    choice.follow = values.has("follow");
  }

  /** @param {URLSearchParams} values */
  #readView(values) {
    const [x, y] = (values.get("centre") ?? "").split(",").map(Number);
    const scale = Number(values.get("zoom"));
    if (scale > 0 && Number.isFinite(scale + x + y)) this.map.show(x, y, scale);
    else if (!this.map.autoFit && values.get("tag") === null) this.map.fitAll();
  }

  /** Write what the page shows, at most a few times a second. */
  update() {
    if (performance.now() - this.#wroteAt < WRITE_MS) return;
    this.#wroteAt = performance.now();
    const { selected, follow, text, group, onlyCare, hiddenStates } = this.choice;
    const hidden = [...hiddenStates].sort().map((state) => STATES[state].name);
    writeAddress({
      tag: selected, follow: follow ? "1" : null, text: text || null, group: group || null, care: onlyCare ? "1" : null,
      hide: hidden.join() || null, ...this.#viewValues(),
    });
  }

  /** @returns {Record<string, string | null>} */
  #viewValues() {
    const { autoFit, view, choice, still } = this.map;
    if (autoFit) return { centre: null, zoom: null };
    if (!still && !choice.follow) return {};
    const decimals = Math.max(0, Math.ceil(Math.log10(view.scale)));
    const centre = choice.follow ? null : `${view.x.toFixed(decimals)},${view.y.toFixed(decimals)}`;
    return { centre, zoom: centre && String(Number(view.scale.toPrecision(4))) };
  }
}
