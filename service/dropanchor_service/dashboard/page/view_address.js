/** What the page shows, in its address: tags, part of the map, and filter. A copied link shows the same. */

import { isAddressRead, listIn, listText, readAddress, writeAddress } from "../data/address.js";
import { STATES } from "../data/states.js";

const WRITE_MS = 500;
/** Of tags that the filter shows alone. */
const KINDS = ["care", "alarms"];

export class ViewAddress {
  #wroteAt = -Infinity;

  /** @param {import("./choice.js").Choice} choice @param {import("../map/map.js").LiveMap} map @param {HTMLInputElement} filter
   * @param {(tags: readonly string[]) => void} pick */
  constructor(choice, map, filter, pick) {
    this.choice = choice;
    this.map = map;
    this.filter = filter;
    this.pick = pick;
    addEventListener("hashchange", () => this.read());
    this.read();
  }

  /** Show what the address says. */
  read() {
    const { choice, filter } = this;
    const values = readAddress();
    const hidden = (values.get("hide") ?? "").split(",");
    filter.value = values.get("text") ?? "";
    choice.filter({
      text: filter.value, group: values.get("group") ?? "", only: KINDS.find((kind) => values.has(kind)) ?? "",
      hidden: STATES.flatMap(({ name }, number) => (hidden.includes(name) ? [number] : [])),
    });
    const tags = listIn(values.get("tags") ?? "");
    this.pick(tags.length > 0 ? tags : [values.get("tag") ?? []].flat());
    this.#readView(values);
    choice.follow = values.has("follow");
  }

  /** @param {URLSearchParams} values */
  #readView(values) {
    const [x, y] = (values.get("centre") ?? "").split(",").map(Number);
    const scale = Number(values.get("zoom"));
    if (scale > 0 && Number.isFinite(scale + x + y)) this.map.show(x, y, scale);
    else if (!this.map.autoFit && this.choice.tags.length === 0) this.map.fitAll();
  }

  /** Write what the page shows, at most a few times a second, but not over an address that the page has yet to read. */
  update() {
    if (performance.now() - this.#wroteAt < WRITE_MS || !isAddressRead()) return;
    this.#wroteAt = performance.now();
    const { selected, several, follow, text, group, only, hiddenStates } = this.choice;
    const hidden = [...hiddenStates].sort().map((state) => STATES[state].name);
    writeAddress({
      tag: selected, tags: several.length > 0 ? listText(several) : null, follow: follow ? "1" : null, text: text || null, group: group || null,
      hide: hidden.join() || null, ...Object.fromEntries(KINDS.map((kind) => [kind, only === kind ? "1" : null])), ...this.#viewValues(),
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
