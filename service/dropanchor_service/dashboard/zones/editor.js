/** Draw a new zone, or edit one. Nothing changes for others until it is saved. */

import { ChangedMeanwhileError } from "../data/access.js";
import { placeIn, withCorner } from "./shape_edit.js";
import { t } from "../i18n/language.js";
import { refusalInForm } from "../i18n/said.js";

/** @typedef {import("./zone_store.js").Zone} Zone @typedef {import("./zone_store.js").Shape} Shape */

const COLOUR = "#2f6fde";

/** Return an id made of the name that no zone has yet. @param {string} name @param {readonly Zone[]} zones */
export function newId(name, zones) {
  const base = name.trim().toLowerCase().replace(/[^a-z0-9._-]+/g, "-").replace(/^-+|-+$/g, "").slice(0, 56) || "zone";
  const taken = new Set(zones.map(({ id }) => id));
  for (let number = 1; ; number++) {
    const id = number === 1 ? base : `${base}-${number}`;
    if (!taken.has(id)) return id;
  }
}

/** Event: "change". */
export class ZoneEditor extends EventTarget {
  /** What is being edited. Its id is empty while it is new. @type {Zone | null} */
  zone = null;
  /** Whether clicks on the map add corners. */
  drawing = false;
  /** Why the last attempt to save failed. */
  problem = "";
  /** Where on the map that is. @type {[number, number] | null} */
  problemAt = null;
  /** Whether somebody else has changed the zone. */
  conflict = false;
  #etag = /** @type {string | null} */ (null);

  /** @param {import("./zone_store.js").ZoneStore} store */
  constructor(store) {
    super();
    this.store = store;
  }

  get isNew() {
    return this.#etag === null;
  }

  /** @param {Shape} shape */
  begin(shape) {
    this.#etag = null;
    this.drawing = true;
    this.zone = {
      id: "", name: "", colour: COLOUR, shape, enter: true, exit: true, dwell_s: null, speed_mps: null, delay_s: 1, tags: [], groups: [],
    };
    this.#say(null);
  }

  /** Edit a zone as it is now. @param {string} id */
  async open(id) {
    try {
      const { item, etag } = await this.store.items.read(id);
      this.zone = /** @type {Zone} */ (/** @type {unknown} */ (item));
      this.#etag = etag;
      this.drawing = false;
      this.#say(null);
    } catch (error) {
      this.#say(error);
    }
  }

  /** @param {Partial<Zone>} values */
  change(values) {
    if (!this.zone) return;
    this.zone = { ...this.zone, ...values };
    this.problemAt = null;
    this.#changed();
  }

  stopDrawing() {
    this.drawing = false;
    this.#changed();
  }

  close() {
    this.zone = null;
    this.drawing = false;
    this.#say(null);
  }

  /** Take a click on the map. Return whether it was for the zone. @param {number} x @param {number} y */
  click(x, y) {
    if (!this.zone || !this.drawing) return false;
    const { shape } = this.zone;
    this.change({ shape: shape.type === "circle" ? { ...shape, x, y } : withCorner(shape, x, y) });
    return true;
  }

  /** Save what is being edited. Return the id, or null when the service refuses it. */
  async save() {
    if (!this.zone) return null;
    let id = this.zone.id;
    const done = await this.#attempt(async () => {
      const zone = /** @type {Zone} */ (this.zone);
      if (this.#etag === null) id = await this.#create(zone);
      else await this.store.items.save(zone, this.#etag);
    });
    return done ? id : null;
  }

  /** Save a new zone with an id that is free. Return the id. @param {Zone} zone @returns {Promise<string>} */
  async #create(zone) {
    const id = newId(zone.name, this.store.zones);
    try {
      await this.store.items.save({ ...zone, id }, null);
      return id;
    } catch (error) {
      if (!(error instanceof ChangedMeanwhileError)) throw error;
      await this.store.refresh(); // somebody else has made a zone with this id
      if (newId(zone.name, this.store.zones) === id) throw error;
      return this.#create(zone);
    }
  }

  async remove() {
    const { id } = /** @type {Zone} */ (this.zone);
    return this.#attempt(() => this.store.items.remove(id, this.#etag ?? ""));
  }

  /** @param {() => Promise<void>} send */
  async #attempt(send) {
    try {
      await send();
      await this.store.refresh();
      this.close();
      return true;
    } catch (error) {
      this.#say(error);
      return false;
    }
  }

  /** @param {unknown} error null: none */
  #say(error) {
    this.conflict = error instanceof ChangedMeanwhileError;
    this.problem = error === null ? "" : this.conflict ? t("zone.conflict") : refusalInForm(error);
    this.problemAt = error instanceof Error ? placeIn(error.message) : null;
    this.#changed();
  }

  #changed() {
    this.dispatchEvent(new Event("change"));
  }
}
