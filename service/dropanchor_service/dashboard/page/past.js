/** Switch the page between the present and the past. In the past the fleet is fed from stored tracks instead of the stream. */

import { momentIn, momentValues } from "./address.js";
import { isAddressRead, writeAddress } from "../data/address.js";
import { FiguresPanel } from "../panel/figures_panel.js";
import { HeatPanel } from "../panel/heat_panel.js";
import { heightsOfTrack } from "../panel/height_plot.js";
import { PastBar } from "../panel/past_bar.js";
import { Then } from "../panel/then.js";
import { PastFigures } from "../panel/past_figures.js";
import { PastTrails } from "../data/past_trails.js";
import { ChosenTracks } from "../data/chosen_tracks.js";
import { HOUR_MS, afterPause, gapsBetween, lastHour } from "../data/periods.js";
import { Lane } from "../panel/lane.js";
import { Replay } from "../data/replay.js";
import { StoredTimes } from "../data/stored_times.js";
import { readTracks } from "../data/track_reader.js";
import { frameAt } from "../data/tracks.js";
import { TRAIL_S } from "../data/trails.js";
import { t } from "../i18n/language.js";

const TICK_MS = 100;
/** With reduced motion the dots move once a second. */
const CALM_TICK_MS = 1000;
const TRAIL_POINTS = 60;
const ADDRESS_MS = 1000;

/**
 * @typedef {object} Page what the past needs of the page
 * @property {import("../data/fleet.js").Fleet} fleet
 * @property {import("../data/trails.js").Trails} trails
 * @property {import("../data/roster.js").Roster} roster
 * @property {import("../data/evidence.js").Evidence} evidence
 * @property {import("../map/map.js").LiveMap} map
 * @property {import("./choice.js").Choice} choice
 * @property {import("../data/connection.js").Connection} connection
 * @property {import("./one_panel.js").Panels} panels
 * @property {import("../data/changes.js").Changes} changes
 * @property {() => void} updatePanels
 * @property {(id: string) => HTMLElement} byId
 */

export class Past {
  active = false;
  /** Follow the change between present and past. */
  became = (/** @type {boolean} */ _isPast) => {};
  replay = new Replay();
  #times = new StoredTimes();
  #trails = new PastTrails();
  #tracks = new ChosenTracks();
  #hasHistory = false;
  #shownAt = 0;
  #wroteAt = 0;

  /** @param {Page} page */
  constructor(page) {
    this.page = page;
    this.bar = new PastBar(/** @type {HTMLFormElement} */ (page.byId("past")), this.replay, this.#times);
    this.lane = new Lane(page.byId("lane"), this.replay);
    this.replay.afterPause = (time_ms) => (this.bar.skips ? afterPause([...gapsBetween(this.#times.stretches ?? []), ...this.lane.stops], time_ms) : time_ms);
    this.figures = new PastFigures(page.byId("past-figures"), this.replay, page.choice);
    new Then(page.byId("then"), this.bar, page.choice, page.map, page.changes);
    this.heat = new HeatPanel(this.bar.heatButton, page.byId("heat"), page.map, this.replay, page.choice);
    new FiguresPanel(this.bar.figuresButton, /** @type {HTMLDialogElement} */ (page.byId("figures")), this.replay, page.choice, page.fleet, page.panels);
    page.map.trackOf = (tag) => this.#trackOf(tag);
    page.panels.add("past", { isOpen: () => this.active, leave: () => this.leave() });
    page.panels.add("heat", { isOpen: () => this.heat.map.active, leave: () => this.heat.hide() });
    page.byId("history").addEventListener("click", () => page.panels.toggle("past", () => this.enter()));
    this.bar.addEventListener("leave", () => this.leave());
    this.replay.addEventListener("time", () => this.#show());
    this.replay.addEventListener("period", () => this.#askForTimes());
    for (const name of ["period", "state"]) this.replay.addEventListener(name, () => this.#writeAddress());
    this.replay.addEventListener("period", () => this.update());
    this.#tracks.addEventListener("change", () => page.map.redraw());
    addEventListener("hashchange", () => this.#readAddress());
    document.addEventListener("keydown", (event) => this.#onKey(event));
    this.#tick(performance.now());
  }

  /** Ask whether there is a history, fill the trails from it, and go where the address points. */
  async start() {
    const { fleet, trails, map } = this.page;
    this.#hasHistory = (await this.#times.loadWhole()) === true;
    this.#readAddress();
    if (!this.#hasHistory) return;
    const end_ms = Date.now();
    const zero_ms = performance.now() - end_ms;
    const tracks = await readTracks(end_ms - TRAIL_S * 1000, end_ms, TRAIL_POINTS).catch(() => null);
    for (const track of tracks ?? []) trails.prepend(track, zero_ms);
    if (!fleet.past) map.redraw();
  }

  /** Request the tracks of the selected tags: recent ones, or those of the period that is shown. */
  update() {
    if (!this.#hasHistory) return;
    const { from_ms, to_ms } = this.replay;
    if (!this.active) this.#tracks.request(this.page.choice.tags);
    else if (from_ms < to_ms) this.#tracks.requestPeriod(this.page.choice.tags, from_ms, to_ms);
    const { selected } = this.page.choice;
    this.lane.box.style.setProperty("--track", this.page.choice.colourOf(selected ?? ""));
    this.lane.show(this.active ? this.#trackOf(selected) ?? null : null);
  }

  enter() {
    this.#become(true);
    const now_ms = Date.now();
    this.bar.suggest(now_ms);
    this.#openNewest(now_ms);
    this.page.byId("past").querySelector("input")?.focus();
  }

  /** Show the last hour with poses, from the first of them. @param {number} now_ms */
  async #openNewest(now_ms) {
    const answer = await this.#times.loadWhole();
    this.#hasHistory = answer === true;
    if (answer === false) return this.bar.explain(t("past.no_history"));
    const { whole } = this.#times;
    if (answer && !whole) return this.bar.explain(t("past.empty"));
    const to_ms = Math.min(now_ms, whole?.to_ms ?? now_ms);
    const stretches = (await this.#times.within(to_ms - HOUR_MS, to_ms)) ?? [];
    const { from_ms } = lastHour(stretches, to_ms, whole?.from_ms ?? 0);
    if (this.active && !this.replay.isLoaded && !this.replay.loading) this.replay.open(from_ms, to_ms); // unless a person has chosen one meanwhile
    return undefined;
  }

  /** Ask when there are poses in a period that has just been chosen. */
  #askForTimes() {
    const { from_ms, to_ms, isLoaded } = this.replay;
    if (!isLoaded) this.#times.load(from_ms, to_ms);
  }

  leave() {
    if (!this.active) return;
    this.replay.close();
    this.heat.hide();
    this.#become(false);
    this.#writeAddress();
    this.page.connection.retry(); // the service sends all poses again
    this.page.byId("history").focus();
  }

  /** @param {boolean} active */
  #become(active) {
    const { byId, evidence, fleet, map, roster, trails } = this.page;
    this.active = fleet.past = roster.hidden = evidence.hidden = active;
    map.trails = active ? /** @type {any} */ (this.#trails) : trails;
    byId("past").hidden = !active;
    byId("history").setAttribute("aria-pressed", String(active));
    document.body.dataset.time = active ? "past" : "present";
    if (active) fleet.replace({ t_ns: 0, tags: [] }, 0);
    else fleet.current = false;
    byId("spoken").textContent = t(active ? "past.shows" : "past.shows_present");
    for (const id of ["past-figures", "then"]) byId(id).hidden = true;
    this.became(active);
    this.page.updatePanels();
  }

  /** Put the poses of the shown time into the fleet. */
  #show() {
    if (!this.active) return;
    const { fleet, map } = this.page;
    const { tracks, time_ms } = this.replay;
    const membership = fleet.membership;
    fleet.replace(frameAt(tracks, time_ms), performance.now());
    this.#trails.show(tracks, time_ms);
    this.#shownAt = performance.now();
    if (this.#shownAt - this.#wroteAt > ADDRESS_MS) this.#writeAddress();
    if (membership !== fleet.membership) this.page.updatePanels();
    map.redraw();
  }

  #tick(/** @type {number} */ before_ms) {
    const now_ms = performance.now();
    if (this.active) {
      this.replay.advance(now_ms - before_ms);
      if (now_ms - this.#shownAt > TICK_MS / 2) this.#show(); // ages count from the shown time, not from now
    }
    const calm = matchMedia("(prefers-reduced-motion: reduce)").matches && this.replay.playing;
    setTimeout(() => this.#tick(now_ms), calm ? CALM_TICK_MS : TICK_MS);
  }

  /** Return the track of the period that is shown, or the recent one. @param {string | null} tag */
  #trackOf(tag) {
    return this.#tracks.of(tag) ?? (this.active ? this.replay.figures.get(tag) : null);
  }

  /** Return the heights of a tag over the shown period. @param {string} tag */
  heightsOf(tag) {
    return heightsOfTrack(this.replay.figures.get(tag), this.replay);
  }

  #readAddress() {
    const moment = momentIn(location.hash);
    if (!moment || (this.active && this.#isShown(moment))) return;
    this.page.panels.open("past", () => {
      this.#become(true);
      if (!this.#hasHistory) return this.bar.explain(t("past.no_history"));
      this.replay.speed = moment.speed;
      this.replay.open(moment.from_ms, moment.to_ms, moment.time_ms);
      return undefined;
    });
  }

  /** @param {import("./address.js").Moment} moment */
  #isShown({ from_ms, to_ms, time_ms }) {
    const { replay } = this;
    return from_ms === replay.from_ms && to_ms === replay.to_ms && Math.abs(time_ms - replay.time_ms) < 2000;
  }

  #writeAddress() {
    if (!isAddressRead()) return; // never over a link that was just followed
    this.#wroteAt = performance.now();
    const { from_ms, to_ms, time_ms, speed } = this.replay;
    const isChosen = this.active && to_ms > from_ms;
    if (!isChosen && this.active) return;
    const moment = isChosen ? { from_ms, to_ms, time_ms, speed } : null;
    if (isChosen || momentIn(location.hash)) writeAddress(momentValues(moment));
  }

  /** @param {KeyboardEvent} event */
  #onKey(event) {
    const target = /** @type {HTMLElement} */ (event.target);
    const isFree = !target.closest("input:not([type=range]), button, select, textarea, a, [role=grid]");
    if (!this.active || event.key !== " " || !isFree) return;
    event.preventDefault();
    this.replay.play(!this.replay.playing);
  }
}
