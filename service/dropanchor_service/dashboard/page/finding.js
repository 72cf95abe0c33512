/** Find tags and act on them: keys of the filter, several selected tags, and the menu of what can be done here. */

import { FilterKeys } from "./filter_keys.js";
import { Here } from "./here.js";
import { listenForQuestions } from "./asked.js";
import { Menu } from "../panel/menu.js";
import { Rectangle } from "../map/rectangle.js";
import { SeveralPanel } from "../panel/several.js";
import { t } from "../i18n/language.js";

const SAID_MS = 4000;

/**
 * @typedef {object} Page what finding needs of the page
 * @property {import("../map/map.js").LiveMap} map
 * @property {import("../data/fleet.js").Fleet} fleet
 * @property {import("../data/roster.js").Roster} roster
 * @property {import("./choice.js").Choice} choice
 * @property {import("../panel/table.js").TagTable} table
 * @property {import("../setup/setup.js").Setup} setup
 * @property {import("../plan/plans.js").Plans} plans
 * @property {import("../zones/zones.js").Zones} zones
 * @property {import("../map/measure.js").Measure} measure
 * @property {import("./past.js").Past} past
 * @property {import("./one_panel.js").Panels} panels
 * @property {(tag: string | null, then?: () => void) => void} select
 * @property {(tags: readonly string[], gathering?: boolean) => void} pickAll
 * @property {(id: string) => HTMLElement} byId
 */

export class Finding {
  #timer = 0;

  /** @param {Page} page */
  constructor(page) {
    this.page = page;
    const { byId, choice, fleet, map, panels, past, roster, select, setup, table } = page;
    this.menu = new Menu(byId("menu"), byId("menu-title"), byId("menu-items"));
    const say = (/** @type {string} */ text) => this.#say(text);
    this.here = new Here({ ...page, menu: this.menu, say });
    this.several = new SeveralPanel(byId("several"), fleet, roster, choice, setup.changes, past, () => select(null));
    new FilterKeys(/** @type {HTMLInputElement} */ (byId("filter")), table, choice, select, say);
    new Rectangle(map, (rows) => this.pick([...choice.tags, ...rows.map((row) => fleet.names[row])], "range"));
    listenForQuestions(map.canvas, (at) => this.#askMap(at), () => this.#askMapByKey());
    listenForQuestions(table.box, (at) => this.#askTable(at), () => this.#askTableByKey());
    panels.add("several", { isOpen: () => choice.several.length > 0, leave: () => choice.select(null) });
  }

  /** @param {import("../plan/geodesy.js").Georeference | null} georeference */
  set georeference(georeference) {
    this.here.georeference = georeference;
  }

  update() {
    this.several.update();
  }

  /** Take tags that were pressed. @param {readonly string[]} tags @param {import("../panel/table.js").Pick} pick */
  pick(tags, pick) {
    const { choice, pickAll, select } = this.page;
    if (pick === "range") pickAll(tags);
    else if (pick === "toggle" || choice.gathering) pickAll(choice.toggled(tags[0]), choice.gathering);
    else select(tags[0]);
    if (choice.several.length > 0) this.page.byId("spoken").textContent = t("several.selected", { n: choice.several.length });
  }

  /** Take a press on the map. @param {number} row −1: no tag @param {boolean} isAlso */
  pickOnMap(row, isAlso) {
    const { choice, fleet, select } = this.page;
    if (row >= 0) this.pick([fleet.names[row]], isAlso ? "toggle" : "only");
    else if (!isAlso && !choice.gathering) select(null);
  }

  /** @param {import("./asked.js").Place} at */
  #askMap({ clientX, clientY }) {
    const { map } = this.page;
    const { left, top } = map.canvas.getBoundingClientRect();
    const [px, py] = [clientX - left, clientY - top];
    this.#ask(map.tagAt(px, py), px, py);
  }

  /** Ask for the selected tag where it is in view, and else for the middle of the map. */
  #askMapByKey() {
    const { choice, fleet, map } = this.page;
    const { view } = map;
    const row = fleet.row(choice.selected);
    const [px, py] = [view.screenX(fleet.drawnX[row]), view.screenY(fleet.drawnY[row])];
    const isInView = px >= 0 && px <= view.width && py >= 0 && py <= view.height;
    if (isInView) this.#ask(row, px, py);
    else this.#ask(-1, view.width / 2, view.height / 2);
  }

  /** @param {number} row −1: the place @param {number} px on the map @param {number} py */
  #ask(row, px, py) {
    const { map } = this.page;
    const { left, top } = map.canvas.getBoundingClientRect();
    const [x, y] = row < 0 ? [map.view.worldX(px), map.view.worldY(py)] : this.#placeOf(row);
    this.here.open({ x, y, left: left + px, top: top + py }, row);
  }

  /** Return where a tag is, NaN where its dot is no place of the map. @param {number} row */
  #placeOf(row) {
    const { fleet } = this.page;
    return fleet.isTurned(row) ? [NaN, NaN] : [fleet.drawnX[row], fleet.drawnY[row]];
  }

  /** @param {import("./asked.js").Place} at */
  #askTable({ clientX, clientY, target }) {
    const tag = /** @type {HTMLElement} */ (target).closest("tr")?.dataset.tag;
    if (tag !== undefined) this.#askTag(tag, clientX, clientY);
  }

  #askTableByKey() {
    const { active } = this.page.table;
    if (!active) return;
    const { left, bottom } = this.page.byId(active.id).getBoundingClientRect();
    this.#askTag(active.tag, left + 40, bottom);
  }

  /** @param {string} tag @param {number} left @param {number} top */
  #askTag(tag, left, top) {
    const row = this.page.fleet.row(tag);
    const [x, y] = this.#placeOf(row);
    this.here.open({ x, y, left, top }, row);
  }

  /** Say something for a moment. @param {string} text */
  #say(text) {
    const line = this.page.byId("said");
    line.textContent = text;
    line.hidden = false;
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => (line.hidden = true), SAID_MS);
  }
}
