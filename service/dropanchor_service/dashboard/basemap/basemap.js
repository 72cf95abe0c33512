/** Connect the base map: what the service has, the frame of the site, the switch, the attribution and the map. */

import { writeAddress } from "../data/address.js";
import { api, getJson } from "../data/connection.js";
import { chosen, remember } from "../data/display.js";
import { isLimited } from "../data/shared.js";
import { Painter } from "./painter.js";
import { PaintingThread } from "./thread.js";
import { Tiles } from "./tiles.js";

/** @typedef {{text: string, link: string | null}} Credit */
/** @typedef {import("./painter.js").Description & {attribution: Credit[]}} Description */

const OFF = "off";

export class Basemap {
  thread = new PaintingThread();
  tiles = new Tiles(this.thread);
  /** @type {Description | null} */
  #description = null;
  /** @type {import("../plan/geodesy.js").Georeference | null} */
  #origin = null;
  #isOn = true;

  /** @param {import("../map/map.js").LiveMap} map @param {import("../data/connection.js").Connection} connection
   * @param {HTMLInputElement} tick turns it on and off @param {HTMLElement} attribution */
  constructor(map, connection, tick, attribution) {
    this.map = map;
    this.tick = tick;
    this.attribution = attribution;
    this.painter = new Painter(this.thread, this.tiles, () => map.redraw());
    map.underlays.unshift(({ ctx, view, palette }) => {
      if (this.#isShown && this.#description && this.#origin) this.painter.draw(ctx, view, palette, this.#description, this.#origin);
    });
    this.tiles.addEventListener("change", () => map.redraw());
    tick.addEventListener("change", () => {
      remember({ basemap: tick.checked ? "on" : OFF });
      writeAddress({ basemap: tick.checked ? null : OFF });
      this.#update();
    });
    addEventListener("hashchange", () => this.#update());
    connection.addEventListener("status", () => connection.status === "live" && this.#refresh());
    connection.addEventListener("site", (event) => {
      const { georeference } = /** @type {CustomEvent} */ (event).detail;
      if (JSON.stringify(georeference) === JSON.stringify(this.#origin)) return;
      this.#origin = georeference;
      this.#update();
    });
  }

  /** For tests and the console. */
  get stats() {
    return { ...this.painter.stats, shown: this.#isShown, still: this.tiles.still && this.painter.still };
  }

  get #isShown() {
    return this.#isOn && this.#description !== null && this.#origin !== null;
  }

  /** Request what the service has. A failure leaves what was known: the page's connection says what is wrong. */
  async #refresh() {
    if (isLimited) return; // such a link shows its tags and nothing else
    const answer = await getJson(api("basemap")).catch(() => null);
    if (!answer || JSON.stringify(answer.tiles) === JSON.stringify(this.#description)) return;
    this.#description = answer.tiles;
    if (this.#description) this.tiles.reset(this.#description.media_type);
    this.attribution.replaceChildren(...(this.#description?.attribution ?? []).map(creditNode));
    this.#update();
  }

  #update() {
    this.#isOn = this.tick.checked = chosen("basemap", null) !== OFF;
    /** @type {HTMLElement} */ (this.tick.parentElement).hidden = this.#description === null || this.#origin === null;
    this.attribution.hidden = !this.#isShown || this.attribution.childNodes.length === 0;
    this.map.redraw();
  }
}

/** @param {Credit} credit */
function creditNode({ text, link }) {
  if (link === null) return document.createTextNode(text);
  return Object.assign(document.createElement("a"), { href: link, target: "_blank", rel: "noopener noreferrer", textContent: text });
}
