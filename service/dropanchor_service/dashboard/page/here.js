/** What can be done at a place of the map, or with a tag: the items of the menu that a right-click opens. */

import { isLimited } from "../data/shared.js";
import { STATES } from "../data/states.js";
import { t } from "../i18n/language.js";
import { latLonOfSite } from "../plan/geodesy.js";
import { toCentimetre } from "../setup/gestures.js";

/** Tags that the menu offers for a place. Those whose place is least known come first. */
const OFFERED = 8;
const DEGREES = 6;

/** @typedef {import("../panel/menu.js").Item} Item */
/** @typedef {{x: number, y: number, left: number, top: number}} Spot m, and pixels of the window */

/**
 * @typedef {object} Parts what the menu acts on
 * @property {import("../data/fleet.js").Fleet} fleet
 * @property {import("./choice.js").Choice} choice
 * @property {import("../setup/setup.js").Setup} setup
 * @property {import("../zones/zones.js").Zones} zones
 * @property {import("../map/measure.js").Measure} measure
 * @property {import("./past.js").Past} past
 * @property {import("../panel/menu.js").Menu} menu
 * @property {import("./one_panel.js").Panels} panels
 * @property {(tag: string, then?: () => void) => void} select its details; `then`: once nothing typed is in the way
 * @property {(tags: readonly string[], gathering?: boolean) => void} pickAll
 * @property {(text: string) => void} say
 */

export class Here {
  /** @type {import("../plan/geodesy.js").Georeference | null} */
  georeference = null;

  /** @param {Parts} parts */
  constructor(parts) {
    this.parts = parts;
  }

  /** Open the menu of a place, or of the tag there. @param {Spot} spot @param {number} row −1: no tag */
  open(spot, row) {
    const { fleet, menu } = this.parts;
    const title = row < 0 ? t("here.place") : fleet.labels[row];
    const items = row < 0 ? this.#placeItems(spot) : this.#tagItems(fleet.names[row]);
    const isPlace = Number.isFinite(spot.x + spot.y);
    menu.open(spot.left, spot.top, title, [...items, ...(isPlace ? this.#everyItems(spot) : [])]);
  }

  /** Whether this page may change the site, and shows it as it is now. */
  get #mayWrite() {
    return this.parts.setup.changes.mayWrite && !this.parts.past.active;
  }

  /** @param {string} tag @returns {Item[]} */
  #tagItems(tag) {
    const { choice, past, pickAll, select, setup } = this.parts;
    const isAlso = choice.several.includes(tag);
    return [
      { label: t("here.details"), act: () => select(tag) },
      { label: t("tag.follow"), act: () => this.#follow(tag) },
      { label: t(isAlso ? "here.take_out" : "here.select_also"), act: () => pickAll(isAlso ? choice.toggled(tag) : [...choice.tags, tag], isAlso ? choice.gathering : true) },
      ...(past.active || isLimited ? [] : [{ label: t("here.past"), act: () => this.#showPast(tag) }]),
      ...(this.#mayWrite ? [{ label: t("here.settings"), act: () => select(tag, () => setup.tagPanel.openSettings()) }] : []),
    ];
  }

  /** @param {string} tag */
  #follow(tag) {
    const { choice, select } = this.parts;
    select(tag, () => (choice.follow = true));
  }

  /** @param {string} tag */
  #showPast(tag) {
    const { panels, past, select } = this.parts;
    select(tag, () => panels.open("past", () => past.enter()));
  }

  /** @param {Spot} spot @returns {Item[]} */
  #placeItems(spot) {
    if (!this.#mayWrite) return [];
    const { setup, zones } = this.parts;
    const [x, y] = [toCentimetre(spot.x), toCentimetre(spot.y)];
    return [
      ...this.#startItems(spot),
      ...(zones.mayBegin ? [
        { label: t("here.circle"), act: () => zones.beginAt("circle", x, y) },
        { label: t("here.polygon"), act: () => zones.beginAt("polygon", x, y) },
      ] : []),
      { label: t("here.anchor"), act: () => setup.anchorPanel.add(undefined, { x, y }) },
    ];
  }

  /** Offer that the selected tag is here, or to choose which one is. @param {Spot} spot @returns {Item[]} */
  #startItems(spot) {
    const { choice, fleet, menu } = this.parts;
    const tag = choice.selected;
    if (tag !== null && fleet.row(tag) >= 0) return [{ label: t("here.start", { tag: fleet.labels[fleet.row(tag)] }), act: () => this.#start(tag, spot) }];
    const tags = this.#leastKnown();
    if (tags.length === 0) return [];
    const ask = () => menu.open(spot.left, spot.top, t("here.which"), tags.map((name) => (
      { label: fleet.labels[fleet.row(name)], act: () => this.#start(name, spot) }
    )));
    return [{ label: t("here.start_of"), act: ask }];
  }

  /** Return the tags that are shown, those without a place that can be trusted first. */
  #leastKnown() {
    const { choice, fleet } = this.parts;
    const rows = fleet.names.map((_, row) => row).filter((row) => choice.shows(fleet, row));
    const isTrusted = (/** @type {number} */ row) => Number(STATES[fleet.state[row]].trusted);
    return rows.sort((a, b) => isTrusted(a) - isTrusted(b)).slice(0, OFFERED).map((row) => fleet.names[row]);
  }

  /** @param {string} tag @param {Spot} spot */
  #start(tag, { x, y }) {
    const { panels, select, setup } = this.parts;
    select(tag, () => panels.open("start", () => setup.tagPanel.beginStartAt(x, y)));
  }

  /** @param {Spot} spot @returns {Item[]} */
  #everyItems({ x, y }) {
    const { measure, panels } = this.parts;
    const site = `${x.toFixed(2)}, ${y.toFixed(2)}`;
    const point = this.georeference && latLonOfSite(this.georeference, x, y);
    const earth = point && `${point.lat.toFixed(DEGREES)}, ${point.lon.toFixed(DEGREES)}`;
    return [
      { label: t("here.measure"), act: () => panels.open("measure", () => measure.from(x, y)) },
      { label: t("here.copy", { place: `${site} m` }), act: () => this.#copy(site) },
      ...(earth ? [{ label: t("here.copy", { place: earth }), act: () => this.#copy(earth) }] : []),
    ];
  }

  /** Copy a text, also where the page was not opened over HTTPS. @param {string} text */
  #copy(text) {
    const fill = (/** @type {ClipboardEvent} */ event) => {
      event.clipboardData?.setData("text/plain", text);
      event.preventDefault();
    };
    document.addEventListener("copy", fill);
    const isCopied = document.execCommand("copy");
    document.removeEventListener("copy", fill);
    this.parts.say(isCopied ? t("here.copied", { text }) : text);
  }
}
