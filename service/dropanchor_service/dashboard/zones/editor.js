/** Draw a new zone, or edit one. Nothing changes for others until it is saved; each step until then can be undone, too. */

import { ChangedMeanwhileError, ProblemError } from "../data/access.js";
import { DraftSteps } from "../data/draft_steps.js";
import { Saving } from "../data/saving.js";
import { placeIn, withCorner } from "./shape_edit.js";
import { zoneChange } from "./words.js";
import { t } from "../i18n/language.js";
import { refusalInForm } from "../i18n/said.js";

/** @typedef {import("./zone_store.js").Zone} Zone @typedef {import("./zone_store.js").Shape} Shape */

const COLOUR = "#2f6fde";
/** What others see of a zone that is not saved yet. */
const NEW = { value: null, etag: "" };

/** Return an id made of the name that no zone has yet. @param {string} name @param {readonly {id: string}[]} zones */
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
  /** Whether the zone was changed since it was opened. */
  isUnsaved = false;
  saving = new Saving();
  /** Why the last attempt to save failed. */
  problem = "";
  /** Where on the map that is. @type {[number, number] | null} */
  problemAt = null;
  /** Whether somebody else has changed the zone. */
  conflict = false;
  /** The zone as it is for others. @type {import("../data/changes.js").Seen} */
  #seen = NEW;
  /** Grows whenever a zone is read. */
  revision = 0;

  /** @param {import("./zone_store.js").ZoneStore} store @param {import("../data/changes.js").Changes} changes */
  constructor(store, changes) {
    super();
    this.store = store;
    this.changes = changes;
    this.steps = new DraftSteps(changes.history, t("zone.not_saved"), {
      get: () => /** @type {Zone} */ (this.zone).shape,
      put: (/** @type {Shape} */ shape) => this.#takeBack(shape),
    });
    for (const name of ["undone", "redone"]) changes.history.addEventListener(name, (event) => this.#follow(/** @type {CustomEvent} */ (event).detail));
  }

  get isNew() {
    return this.#seen.value === null;
  }

  /** @param {Shape} shape */
  begin(shape) {
    this.steps.forget();
    this.#seen = NEW;
    this.drawing = true;
    this.zone = {
      id: "", name: "", colour: COLOUR, shape, enter: true, exit: true, dwell_s: null, speed_mps: null, enter_severity: "event", dwell_severity: "event", speed_severity: "event", z_min_m: null, z_max_m: null,
      delay_s: 1, tags: [], groups: [],
    };
    this.#say(null);
  }

  /** Edit a zone as it is now. @param {string} id */
  async open(id) {
    try {
      const seen = await this.store.items.read(id);
      this.steps.forget();
      this.#seen = seen;
      this.zone = seen.value;
      this.revision++;
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
    this.isUnsaved = true;
    this.problemAt = null;
    this.#changed();
  }

  /** Change the shape, so that it can be undone. @param {string} what was done, as a sentence @param {Shape} shape
   * @param {object | string} [gesture] several changes by one gesture are one step */
  reshape(what, shape, gesture = {}) {
    if (!this.zone) return;
    this.steps.keep(what, gesture);
    this.change({ shape });
  }

  /** @param {Shape} shape */
  #takeBack(shape) {
    this.drawing ||= this.isNew && shape.type === "polygon" && shape.points.length < 3;
    this.change({ shape });
  }

  stopDrawing() {
    this.drawing = false;
    this.#changed();
  }

  close() {
    this.steps.forget();
    this.zone = null;
    this.drawing = false;
    this.#say(null);
  }

  /** Take a click on the map. Return whether it was for the zone. @param {number} x @param {number} y */
  click(x, y) {
    if (!this.zone || !this.drawing) return false;
    const { shape } = this.zone;
    if (shape.type === "circle") this.reshape(t("zone.placed"), { ...shape, x, y });
    else this.reshape(t("zone.corner_added"), withCorner(shape, x, y));
    return true;
  }

  /** Save what is being edited. Return the id, or null when the service refuses it. */
  async save() {
    if (!this.zone) return null;
    let id = this.zone.id;
    const done = await this.#attempt(async () => {
      const zone = /** @type {Zone} */ (this.zone);
      if (this.isNew) id = await this.#create(zone);
      else await this.#apply(zone);
    });
    return done ? id : null;
  }

  /** Save a new zone with an id that is free. Return the id. @param {Zone} zone @returns {Promise<string>} */
  async #create(zone) {
    const id = newId(zone.name, this.store.zones);
    try {
      await this.#apply({ ...zone, id });
      return id;
    } catch (error) {
      if (!(error instanceof ChangedMeanwhileError)) throw error;
      await this.store.refresh(); // somebody else has made a zone with this id
      if (newId(zone.name, this.store.zones) === id) throw error;
      return this.#create(zone);
    }
  }

  async remove() {
    return this.#attempt(() => this.#apply(null));
  }

  /** @param {Zone | null} zone null: delete it */
  #apply(zone) {
    const { id } = zone ?? this.#seen.value;
    return this.changes.apply(zoneChange(this.#seen.value, zone), this.store.items.path(id), this.#seen, zone);
  }

  /** Show a change that was undone, unless something else is not saved yet. @param {import("../data/undo.js").Step} step */
  async #follow({ path }) {
    await this.saving.now; // which closes it
    const { zone } = this;
    if (!zone || path !== this.store.items.path(zone.id) || !this.#isUnchanged) return;
    await this.open(zone.id);
    if (this.problem !== "") this.close(); // the change was its creation
  }

  get #isUnchanged() {
    return JSON.stringify(this.zone) === JSON.stringify(this.#seen.value);
  }

  /** @param {() => Promise<void>} send */
  #attempt(send) {
    return this.saving.until(this.#send(send));
  }

  /** @param {() => Promise<void>} send */
  async #send(send) {
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
    this.isUnsaved &&= error !== null;
    this.conflict = error instanceof ChangedMeanwhileError;
    this.problem = error === null ? "" : this.conflict ? t("zone.conflict") : refusalInForm(error);
    this.problemAt = error instanceof ProblemError ? placeIn(error.problem) : null;
    this.#changed();
  }

  #changed() {
    this.dispatchEvent(new Event("change"));
  }
}
