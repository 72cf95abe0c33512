/** Add, align, change and delete floor plans. A draft is on the map of this page only, until it is saved. */

import { boundsAround } from "../map/view.js";
import { DraftSteps } from "../data/draft_steps.js";
import { Saving } from "../data/saving.js";
import { newId } from "../zones/editor.js";
import { stepOf, toCentimetre } from "../setup/gestures.js";
import { newName } from "./plan_name.js";
import { pathOf } from "./plan_store.js";
import { t } from "../i18n/language.js";
import { said } from "../i18n/said.js";
import { aligned, cornersOf, inMiddleOf, isInside, isPlaced, pixelOf } from "./transform.js";

/** @typedef {import("./plan_store.js").Plan} Plan @typedef {import("./transform.js").Point} Point */
/** @typedef {Plan & {points: Point[]}} Draft */
/** @typedef {"" | "move" | "pick" | "place"} Mode what a press on the map does: nothing, move the plan, choose a place on
 * the plan, or say where that is */

const SNAP_PX = 18;
const PADDING_PX = 48;
const MIN_SIDE_M = 0.1;
const MAX_POINTS = 20;

/** Event: "change". */
export class PlanEditor extends EventTarget {
  isOpen = false;
  /** @type {Draft | null} */
  draft = null;
  /** @type {Mode} */
  mode = "";
  /** Distance between the first two points, if a person knows it. @type {number | null} */
  distance_m = null;
  /** Where the site lies on the Earth, if that is known. @type {import("./geodesy.js").Georeference | null} */
  georeference = null;
  /** Whether the last press in search of a place on the plan was beside it. */
  isBeside = false;
  /** Grows whenever the draft is read anew. */
  revision = 0;
  saving = new Saving();
  #isDirty = false;
  /** @type {Promise<import("../data/changes.js").Seen | null>} */
  #seen = Promise.resolve(null);
  #point = -1;
  #grab = { dx: 0, dy: 0 };

  /** @param {import("../map/map.js").LiveMap} map @param {import("../data/changes.js").Changes} changes
   * @param {import("./plan_store.js").PlanStore} store */
  constructor(map, changes, store) {
    super();
    this.map = map;
    this.changes = changes;
    this.store = store;
    this.steps = new DraftSteps(changes.history, t("zone.not_saved"), {
      get: () => this.#laid(),
      put: (/** @type {Pick<Draft, "placement" | "points">} */ laid) => this.#takeBack(laid),
    });
    store.addEventListener("change", () => this.#takePlans());
  }

  get isUnsaved() {
    return this.draft !== null && this.#isDirty;
  }

  open() {
    this.isOpen = true;
    this.#changed();
  }

  close() {
    this.isOpen = false;
    this.discard();
  }

  /** Edit a plan, and bring it into view. @param {string} id */
  select(id) {
    const plan = this.store.find(id);
    if (!plan || this.draft?.id === id) return;
    this.#edit(plan);
    this.#reveal(plan);
    this.#changed();
  }

  /** Upload a file as a new plan. Return what a person should know about its placement. Throws Error when it is refused.
   * @param {File} file @param {Record<string, string>} query */
  async add(file, query) {
    const { image, placement, note, note_phrase } = await this.store.upload(file, query);
    const name = newName(file.name.replace(/\.[^.]*$/, ""), this.store.plans);
    const id = newId(name || "plan", /** @type {any} */ (this.store.plans));
    const plan = { id, name, image, placement: placement ?? inMiddleOf(this.map.view, image) };
    if (!(await this.changes.create(t("plans.added", { plan: name }), pathOf(id), plan))) return said(note, note_phrase);
    await this.store.refresh();
    this.select(id);
    return said(note, note_phrase);
  }

  /** @param {Partial<Draft>} values */
  change(values) {
    if (!this.draft) return;
    this.draft = { ...this.draft, ...values };
    this.#isDirty = true;
    this.#changed();
  }

  #laid() {
    const { placement, points } = /** @type {Draft} */ (this.draft);
    return { placement, points };
  }

  /** @param {Pick<Draft, "placement" | "points">} laid */
  #takeBack(laid) {
    if (this.mode === "place") this.mode = ""; // the point may be gone
    this.change(laid);
  }

  /** @param {Mode} mode */
  setMode(mode) {
    const isFull = mode === "pick" && this.draft?.points.length === MAX_POINTS;
    this.mode = mode === this.mode || isFull ? "" : mode;
    this.isBeside = false;
    if (this.mode === "pick" && this.draft) this.#reveal(this.draft);
    this.#changed();
  }

  /** Say where a point is. @param {number} index @param {number | null} x @param {number | null} y */
  placePoint(index, x, y) {
    if (!this.draft) return;
    this.steps.keep(t("plans.point_placed"), `place ${index}`);
    this.#align(this.draft.points.with(index, { ...this.draft.points[index], x, y }));
  }

  /** @param {number} index */
  removePoint(index) {
    this.mode = "";
    if (!this.draft) return;
    this.steps.keep(t("plans.point_removed"));
    this.#align(this.draft.points.toSpliced(index, 1));
  }

  /** @param {number | null} distance_m */
  setDistance(distance_m) {
    this.distance_m = distance_m;
    if (this.draft) this.#align(this.draft.points);
  }

  save() {
    return this.saving.until(this.#save());
  }

  async #save() {
    const { draft } = this;
    const seen = await this.#seen;
    if (!draft || !seen) return;
    const { points, ...plan } = { ...draft, control_points: draft.points.filter(isPlaced) };
    const done = await this.changes.edit(t("plans.changed", { plan: draft.name || draft.id }), pathOf(draft.id), plan, seen, () => this.#takeNewer(draft.id));
    await this.store.refresh(); // first, so that the map does not show the old plan in between
    if (done && (this.draft === draft || !this.#isDirty)) this.discard(); // it was read again, or nothing was typed meanwhile
  }

  async remove() {
    const { draft } = this;
    const plan = this.store.find(draft?.id ?? "");
    if (!draft || !plan) return;
    if (await this.changes.remove(t("plans.deleted", { plan: plan.name || plan.id }), pathOf(plan.id))) this.discard();
    await this.store.refresh();
  }

  /** Leave the mode, or discard what is not saved. Return whether there was anything. */
  cancel() {
    if (this.mode !== "") this.setMode("");
    else if (this.draft) this.discard();
    else return false;
    return true;
  }

  /** @param {import("../setup/gestures.js").Spot} at */
  press({ x, y, px, py }) {
    const { draft, mode } = this;
    if (!draft || mode === "") return false;
    const pixel = pixelOf(draft.placement, draft.image, x, y);
    if (mode === "place") {
      this.mode = "";
      this.placePoint(this.#point, ...this.#snapped(x, y, px, py));
      return true;
    }
    if (!isInside(draft.image, pixel)) {
      this.isBeside = mode === "pick";
      this.#changed();
      return false; // so that the map can be moved beside the plan
    }
    this.#grab = { dx: draft.placement.x - x, dy: draft.placement.y - y }; // a new one: one drag is one step
    if (mode === "pick") this.#pick(pixel);
    return true;
  }

  /** @param {import("../setup/gestures.js").Spot} at */
  drag({ x, y }) {
    if (this.mode === "move") this.#moveTo(x + this.#grab.dx, y + this.#grab.dy, this.#grab);
  }

  drop() {}

  /** @param {KeyboardEvent} event */
  key(event) {
    const step = stepOf(event);
    if (!this.draft || this.mode !== "move" || !step) return false;
    const { x, y } = this.draft.placement;
    this.#moveTo(x + step[0], y + step[1], "arrows");
    return true;
  }

  /** @param {number} x @param {number} y @param {object | string} gesture */
  #moveTo(x, y, gesture) {
    if (!this.draft) return;
    this.steps.keep(t("plans.moved"), gesture);
    this.change({ placement: { ...this.draft.placement, x: toCentimetre(x), y: toCentimetre(y) } });
  }

  /** @param {import("./transform.js").Pixel} pixel */
  #pick(pixel) {
    const points = [.../** @type {Draft} */ (this.draft).points, { ...pixel, x: null, y: null }];
    this.steps.keep(t("plans.point_added"));
    this.#point = points.length - 1;
    this.mode = "place";
    this.isBeside = false;
    this.#align(points);
  }

  /** Return the place of the anchor at a point on the screen, or the point itself.
   * @param {number} x @param {number} y @param {number} px @param {number} py @returns {[number, number]} */
  #snapped(x, y, px, py) {
    const { anchors, view } = this.map;
    const near = anchors.find((anchor) => Math.hypot(view.screenX(anchor.x) - px, view.screenY(anchor.y) - py) < SNAP_PX);
    return near ? [near.x, near.y] : [toCentimetre(x), toCentimetre(y)];
  }

  /** @param {Point[]} points */
  #align(points) {
    const { placement, image } = /** @type {Draft} */ (this.draft);
    this.change({ points, placement: aligned(placement, image, points, this.distance_m) });
  }

  /** Bring the whole plan into view, unless it is. @param {Plan} plan */
  #reveal({ placement, image }) {
    const { map } = this;
    const corners = cornersOf(placement, image);
    const seen = map.view.free(0);
    map.takeOver();
    if (corners.every(([x, y]) => x > seen.left && x < seen.right && y > seen.bottom && y < seen.top)) return;
    const bounds = /** @type {import("../map/view.js").Bounds} */ (boundsAround(corners, MIN_SIDE_M));
    Object.assign(map.view, map.view.fitted(bounds, Math.min(PADDING_PX, map.view.width / 8)));
  }

  /** @param {Plan} plan @param {Promise<import("../data/changes.js").Seen | null>} [seen] as read from the service */
  #edit(plan, seen = this.changes.read(pathOf(plan.id)).catch(() => null)) {
    this.steps.forget();
    this.draft = { ...plan, points: [...plan.control_points] };
    this.#isDirty = false;
    this.revision++;
    this.distance_m = null;
    this.mode = "";
    this.#seen = seen;
  }

  /** Follow changes of other pages, unless something is not saved yet. */
  #takePlans() {
    const known = this.store.find(this.draft?.id ?? "");
    if (this.draft && !known) this.discard();
    else if (this.draft && known && !this.#isDirty && this.mode === "") this.#edit(known);
    this.#changed();
  }

  /** @param {string} id */
  async #takeNewer(id) {
    const seen = await this.changes.read(pathOf(id)).catch(() => null);
    if (seen) this.#edit(seen.value, Promise.resolve(seen));
    else this.discard();
    this.#changed();
  }

  /** Forget what is not saved. */
  discard() {
    this.steps.forget();
    this.draft = null;
    this.#isDirty = false;
    this.mode = "";
    this.#changed();
  }

  #changed() {
    this.map.redraw();
    this.dispatchEvent(new Event("change"));
  }
}
