/** Place, move, add and delete anchors. A draft is on the map only until it is saved or cancelled: moving an anchor moves tags. */

import { stepOf, toCentimetre } from "./gestures.js";
import { t } from "../i18n/language.js";

/** @typedef {import("../map/draw_site.js").Anchor} Anchor */
/** @typedef {import("../data/changes.js").Seen} Seen */

const REACH_PX = 18;
const DRAG_PX = 4;

/** @param {string} id */
const pathOf = (id) => `anchors/${encodeURIComponent(id)}`;

/** @param {Anchor} a @param {Anchor} b */
export const wayBetween = (a, b) => Math.hypot(b.x - a.x, b.y - a.y, b.z - a.z);

/** Event: "change". */
export class AnchorEditor extends EventTarget {
  isOpen = false;
  /** Whether the draft is an anchor that the site does not have yet. */
  isNew = false;
  /** @type {readonly Anchor[]} */
  anchors = [];
  /** The anchor that is being edited. @type {Anchor | null} */
  draft = null;
  /** Choose an anchor that a person pressed on the map. */
  choose = (/** @type {string} */ id) => this.select(id);
  #isDirty = false;
  #isSaving = false;
  /** @type {Promise<Seen | null>} */
  #seen = Promise.resolve(null);
  /** Where the draft was grabbed, and how far from its centre. */
  #grab = { px: 0, py: 0, dx: 0, dy: 0, moves: false };

  /** @param {import("../map/map.js").LiveMap} map @param {import("../data/changes.js").Changes} changes */
  constructor(map, changes) {
    super();
    this.map = map;
    this.changes = changes;
  }

  /** Take the anchors that the site has now. @param {readonly Anchor[]} anchors */
  setAnchors(anchors) {
    this.anchors = anchors;
    const known = anchors.find(({ id }) => id === this.draft?.id);
    if (!this.#isDirty && !this.isNew && this.draft) {
      if (!known) this.draft = null;
      else if (JSON.stringify(known) !== JSON.stringify(this.draft)) this.#edit(known);
    }
    this.#changed();
  }

  /** Whether something would be lost. */
  get isUnsaved() {
    return this.#isDirty && !this.#isSaving;
  }

  /** Where the anchor of the draft stands until it is moved; null: the draft moves none. @returns {Anchor | null} */
  get origin() {
    const { draft } = this;
    const known = this.isNew ? undefined : this.anchors.find(({ id }) => id === draft?.id);
    return draft && known && wayBetween(known, draft) > 0 ? known : null;
  }

  open() {
    this.isOpen = true;
    this.#changed();
  }

  close() {
    this.isOpen = false;
    this.#discard();
    this.#changed();
  }

  /** @param {string} id */
  select(id) {
    const anchor = this.anchors.find((known) => known.id === id);
    if (!anchor || (this.draft?.id === id && !this.isNew)) return;
    this.#discard();
    this.#edit(anchor);
    this.#changed();
  }

  /** Begin a new anchor. @param {string} [id] @param {{x: number, y: number}} [place] m, by default the centre of the map */
  add(id = "", place = this.map.view) {
    this.#discard();
    this.isNew = this.isOpen = true;
    this.draft = { id, x: toCentimetre(place.x), y: toCentimetre(place.y), z: 0 };
    this.#changed();
  }

  /** Change the draft. @param {Partial<Anchor>} values */
  change(values) {
    if (!this.draft) return;
    this.draft = { ...this.draft, ...values };
    this.#isDirty = true;
    this.#changed();
  }

  async save() {
    const { draft, isNew } = this;
    if (!draft || (!isNew && !this.#isDirty)) return;
    this.#isSaving = true;
    const seen = await this.#seen;
    const take = () => this.#takeNewer(draft.id);
    const done = isNew
      ? await this.changes.create(t("anchors.added", { id: draft.id }), pathOf(draft.id), draft)
      : seen !== null && (await this.changes.edit(t("anchors.moved", { id: draft.id }), pathOf(draft.id), draft, seen, take));
    this.#isSaving = false;
    if (!done || this.draft !== draft) return;
    this.anchors = [...this.anchors.filter(({ id }) => id !== draft.id), draft];
    this.#edit(draft);
    this.#changed();
  }

  async remove() {
    const { draft } = this;
    if (!draft) return;
    if (!(await this.changes.remove(t("anchors.deleted", { id: draft.id }), pathOf(draft.id)))) return;
    this.anchors = this.anchors.filter(({ id }) => id !== draft.id);
    this.cancel();
  }

  /** Discard what is not saved. Return whether there was anything. */
  cancel() {
    if (!this.draft) return false;
    this.#discard();
    this.#changed();
    return true;
  }

  /** @param {import("./gestures.js").Spot} at */
  press({ x, y, px, py }) {
    if (!this.isOpen) return false;
    const { view } = this.map;
    const near = this.map.anchors.find((anchor) => Math.hypot(view.screenX(anchor.x) - px, view.screenY(anchor.y) - py) < REACH_PX);
    if (near) {
      if (near.id !== this.draft?.id) this.choose(near.id);
      if (near.id !== this.draft?.id) return false;
      this.#grab = { px, py, dx: near.x - x, dy: near.y - y, moves: false };
      return true;
    }
    if (!this.isNew) return false;
    this.#grab = { px, py, dx: 0, dy: 0, moves: true };
    this.drag({ x, y, px, py });
    return true;
  }

  /** @param {import("./gestures.js").Spot} at */
  drag({ x, y, px, py }) {
    const grab = this.#grab;
    grab.moves ||= Math.hypot(px - grab.px, py - grab.py) >= DRAG_PX;
    if (grab.moves) this.change({ x: toCentimetre(x + grab.dx), y: toCentimetre(y + grab.dy) });
  }

  drop() {}

  /** @param {KeyboardEvent} event */
  key(event) {
    const step = stepOf(event);
    if (!this.draft || !this.isOpen) return false;
    if (event.key === "Enter") this.save();
    if (!step) return event.key === "Enter";
    this.change({ x: toCentimetre(this.draft.x + step[0]), y: toCentimetre(this.draft.y + step[1]) });
    return true;
  }

  /** @param {Anchor} anchor @param {Promise<Seen | null>} [seen] as read from the service */
  #edit(anchor, seen = this.changes.read(pathOf(anchor.id)).catch(() => null)) {
    this.draft = anchor;
    this.isNew = this.#isDirty = false;
    this.#seen = seen;
  }

  /** @param {string} id */
  async #takeNewer(id) {
    this.#discard();
    try {
      const seen = await this.changes.read(pathOf(id));
      this.anchors = [...this.anchors.filter((known) => known.id !== id), seen.value];
      if (this.draft === null) this.#edit(seen.value, Promise.resolve(seen)); // else somebody drags another one already
    } catch {
      this.anchors = this.anchors.filter((known) => known.id !== id);
    }
    this.#changed();
  }

  #discard() {
    this.draft = null;
    this.isNew = this.#isDirty = false;
  }

  #changed() {
    const { draft } = this;
    const shown = draft ? [...this.anchors.filter(({ id }) => id !== draft.id), draft] : this.anchors;
    this.map.setAnchors(shown);
    this.map.redraw();
    this.dispatchEvent(new Event("change"));
  }
}
