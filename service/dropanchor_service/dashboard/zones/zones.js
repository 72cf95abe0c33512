/** Connect zones and events: what the service sends, the map, the two lists and the editor. */

import { boundsAround } from "../map/view.js";
import { drawShape, drawZones } from "./draw_zones.js";
import { ZoneEditor } from "./editor.js";
import { EventList } from "./event_list.js";
import { EventLog } from "./event_log.js";
import { Headcount } from "./headcount.js";
import { Handles } from "./handles.js";
import { isInside, withCorner } from "./shape_edit.js";
import { EventFilter } from "./event_filter.js";
import { FoundEvents } from "./found_events.js";
import { ZoneForm } from "./zone_form.js";
import { ZoneList } from "./zone_list.js";
import { ZoneStore } from "./zone_store.js";
import { t } from "../i18n/language.js";
import { byId } from "../page/parts.js";

const PADDING_PX = 64;
const MIN_SIDE_M = 2;
/** Size of a new circle, and distance of corners that the keyboard adds from the centre of the map. */
const NEW_PX = 80;
/** A click on an event of the past shows what was before it. */
const BEFORE_MS = 10_000;
/** Between two requests for the number of tags inside, however many events there are. */
const REFRESH_MS = 500;

export class Zones {
  store = new ZoneStore();
  log = new EventLog();
  /** Id of a zone. @type {string | null} */
  selected = null;
  /** What the events belong to while the page shows the past. @type {import("../data/replay.js").Replay | null} */
  replay = null;
  /** Events that somebody looks for, or those of the past. */
  found = new FoundEvents();
  #timer = 0;

  /** @param {import("../map/map.js").LiveMap} map @param {import("../data/connection.js").Connection} connection
   * @param {import("../data/changes.js").Changes} changes @param {(tag: string) => void} selectTag
   * @param {import("../page/one_panel.js").Panels} panels */
  constructor(map, connection, changes, selectTag, panels) {
    this.map = map;
    this.connection = connection;
    this.selectTag = selectTag;
    this.panels = panels;
    this.editor = new ZoneEditor(this.store, changes);
    panels.add("zone", { isOpen: () => this.editor.zone !== null, isUnsaved: () => this.editor.isUnsaved, saving: () => this.editor.saving.now, leave: () => this.editor.close() });
    const box = byId("zone-list");
    this.handles = new Handles(byId("handles"), map, this.editor);
    this.events = new EventList(/** @type {HTMLDetailsElement} */ (byId("events")), this.log, (event) => this.pick(event));
    this.filter = new EventFilter(/** @type {HTMLFormElement} */ (byId("event-filter")), map.fleet, this.store);
    this.filter.addEventListener("change", () => this.#find());
    this.found.addEventListener("change", () => this.events.update());
    this.log.addEventListener("event", (event) => this.replay === null && this.found.take(/** @type {CustomEvent} */ (event).detail));
    this.events.more.addEventListener("click", () => this.#findMore());
    const headcount = new Headcount(/** @type {HTMLDialogElement} */ (byId("headcount")), this.store, map.fleet, selectTag);
    this.list = new ZoneList(box, this.store, { select: (id) => this.select(id), edit: (id) => this.edit(id), count: (id) => headcount.open(id) });
    byId("count-all").addEventListener("click", () => headcount.open(null));
    new ZoneForm(/** @type {HTMLFormElement} */ (byId("zone-form")), this.editor, () => this.#addCorner());
    byId("new-polygon").addEventListener("click", () => this.#begin({ type: "polygon", points: [] }));
    byId("new-circle").addEventListener("click", () => this.#begin(this.#newCircle()));
    map.underlays.push((scene) => this.#draw(scene));
    this.store.addEventListener("change", () => this.#update());
    this.editor.addEventListener("change", () => this.#update());
    changes.addEventListener("done", (event) => /** @type {CustomEvent} */ (event).detail.startsWith("zones/") && this.store.refresh());
    this.log.addEventListener("change", () => this.#happened());
    connection.addEventListener("status", () => this.#connected(connection.status === "live"));
  }

  /** Take a click on the map while a zone is drawn. Return whether it was for that. @param {number} px @param {number} py */
  press(px, py) {
    return this.editor.click(this.map.view.worldX(px), this.map.view.worldY(py));
  }

  /** Select a zone and bring it into view. @param {string | null} id */
  select(id) {
    const { map } = this;
    const zone = this.store.zones.find((known) => known.id === id);
    this.selected = zone?.id ?? null;
    if (zone) {
      map.takeOver();
      Object.assign(map.view, map.view.fitted(boundsOf(zone.shape), Math.min(PADDING_PX, map.view.width / 6, map.view.height / 6)));
    }
    this.#update();
  }

  /** @param {boolean} live */
  #connected(live) {
    for (const part of [this.store, this.log]) {
      if (live) part.start();
      else part.stop();
    }
    this.#update();
  }

  /** List the events of the past, which a click leads to, or those of the present. @param {import("../page/past.js").Past} past */
  follow(past) {
    past.replay.addEventListener("period", () => this.#find());
    this.found.addEventListener("change", () => this.replay && past.bar.mark("events", this.found.times));
    past.became = (isPast) => {
      this.replay = isPast ? past.replay : null;
      this.#find();
    };
  }

  /** Return the names of the zones in which a tag is: as the service counts it, and in the past by the pose that is shown. @param {string} tag */
  zonesOf(tag) {
    if (!this.replay) return this.store.zonesOf(tag);
    const { fleet } = this.map;
    const row = fleet.row(tag);
    if (row < 0 || !fleet.style(row).placed || fleet.isTurned(row)) return [];
    const { x, y, z } = fleet.number;
    return this.store.zones.filter((zone) => isInside(zone, x[row], y[row], z[row])).map(({ id, name }) => name || id);
  }

  /** List the events that are wanted; where nothing is said, the latest ones. */
  #find() {
    this.filter.period = this.replay && { from_ms: this.replay.from_ms, to_ms: this.replay.to_ms };
    this.events.log = this.filter.isActive ? this.found : this.log;
    if (this.filter.isActive) this.found.find(this.filter.wanted);
    this.events.update();
  }

  /** List older events, too. */
  async #findMore() {
    if (this.events.log === this.log) await this.found.find(this.filter.wanted);
    else await this.found.more();
    this.events.log = this.found;
    this.events.update();
  }

  /** Show the tag and the zone of an event. @param {import("./words.js").ServiceEvent} event */
  pick({ subject, data, time }) {
    this.replay?.seek(Math.max(this.replay.from_ms, Date.parse(time) - BEFORE_MS));
    if (data.zone !== null) this.select(data.zone);
    this.selectTag(subject);
  }

  #happened() {
    this.events.update();
    if (this.#timer || !this.log.current) return;
    this.#timer = setTimeout(() => {
      this.#timer = 0;
      this.store.refresh();
    }, REFRESH_MS);
  }

  /** Open the list and edit a zone. @param {string} id */
  edit(id) {
    if (id === this.editor.zone?.id) return;
    this.panels.open("zone", () => {
      /** @type {HTMLDetailsElement} */ (byId("zone-list")).open = true;
      this.select(id);
      this.editor.open(id);
    });
  }

  /** Begin a new zone, and keep the map where it is meanwhile. @param {import("./zone_store.js").Shape} shape */
  #begin(shape) {
    this.panels.open("zone", () => {
      this.map.takeOver();
      /** @type {HTMLDetailsElement} */ (byId("zone-list")).open = true;
      this.editor.begin(shape);
    });
  }

  /** Whether this page may begin a new zone now. */
  get mayBegin() {
    return this.store.mayWrite && this.editor.zone === null;
  }

  /** Begin a new zone at a place: a circle around it, or a polygon with its first corner there.
   * @param {"circle" | "polygon"} type @param {number} x m @param {number} y m */
  beginAt(type, x, y) {
    this.#begin(type === "circle" ? this.#newCircle(x, y) : { type, points: [[round(x), round(y)]] });
  }

  /** @param {number} [x] m @param {number} [y] m @returns {import("./zone_store.js").Shape} */
  #newCircle(x = this.map.view.x, y = this.map.view.y) {
    const { scale } = this.map.view;
    return { type: "circle", x: round(x), y: round(y), radius_m: Math.max(0.1, round(NEW_PX / scale)) };
  }

  /** Add a corner without a pointer: around the centre of the map, where the next arrow keys move it. */
  #addCorner() {
    const { zone } = this.editor;
    if (zone?.shape.type !== "polygon") return;
    const { x, y, scale } = this.map.view;
    const turn = (zone.shape.points.length * Math.PI) / 2 + Math.PI / 4;
    this.editor.reshape(t("zone.corner_added"), withCorner(zone.shape, x + (NEW_PX / scale) * Math.cos(turn), y + (NEW_PX / scale) * Math.sin(turn)));
    this.handles.focusLast();
  }

  #update() {
    this.list.update(this.connection.status === "live", this.selected, this.editor.zone !== null);
    this.map.redraw();
  }

  /** @param {import("../map/scene.js").Scene} scene */
  #draw(scene) {
    const { zone } = this.editor;
    const others = this.store.zones.filter(({ id }) => id !== zone?.id);
    drawZones(scene, this.map.layers.isShown("zones") ? others : [], this.store.inside, this.selected);
    if (zone) {
      scene.ctx.save();
      drawShape(scene, zone.shape, { colour: zone.colour, dash: [], width: 2.5 });
      scene.ctx.restore();
    }
    this.handles.place();
  }
}

/** @param {number} metres */
const round = (metres) => Math.round(metres * 100) / 100;

/** @param {import("./zone_store.js").Shape} shape */
function boundsOf(shape) {
  const points = shape.type === "polygon" ? shape.points : /** @type {[number, number][]} */ ([
    [shape.x - shape.radius_m, shape.y - shape.radius_m], [shape.x + shape.radius_m, shape.y + shape.radius_m],
  ]);
  return /** @type {import("../map/view.js").Bounds} */ (boundsAround(points, MIN_SIDE_M));
}
