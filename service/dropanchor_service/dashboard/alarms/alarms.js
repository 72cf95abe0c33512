/** Connect the alarms: their list, the rings on the map, the mark in the table, the title, the sound, and the key. */

import { AlarmList } from "./alarm_list.js";
import { AlarmStore, isPending, tagsOf } from "./alarm_store.js";
import { drawAlarms } from "./draw_alarms.js";
import { Sound } from "./sound.js";
import { t } from "../i18n/language.js";
import { isTyping } from "../page/keyboard.js";
import { byId } from "../page/parts.js";

/** @typedef {import("./alarm_store.js").Alarm} Alarm */

const HOUR_NS = 3600e9;

export class Alarms {
  store = new AlarmStore();

  /** @param {import("../map/map.js").LiveMap} map @param {import("../data/connection.js").Connection} connection
   * @param {import("../data/changes.js").Changes} changes @param {import("../page/choice.js").Choice} choice
   * @param {import("../zones/zones.js").Zones} zones */
  constructor(map, connection, changes, choice, zones) {
    this.changes = changes;
    this.choice = choice;
    this.fleet = map.fleet;
    this.sound = new Sound(/** @type {HTMLInputElement} */ (byId("sound")));
    this.list = new AlarmList(byId("alarms"), this.store, {
      pick: ({ event }) => zones.pick(event),
      acknowledge: (alarm, note) => this.#acknowledge([alarm], note),
      mute: (alarm, on) => this.#mute(alarm, on),
    });
    map.overlays.push((scene) => !this.fleet.past && drawAlarms(scene, this.store.tags, (row) => map.isShown(row)));
    this.store.addEventListener("change", () => {
      this.sound.update(this.store.pending);
      this.list.update();
      map.redraw();
    });
    zones.log.addEventListener("event", (event) => /** @type {CustomEvent} */ (event).detail.data.severity && this.store.refresh());
    changes.addEventListener("done", (event) => /^(zones|event-rules)\//.test(/** @type {CustomEvent} */ (event).detail) && this.store.refresh());
    connection.addEventListener("status", () => (connection.status === "live" ? this.store.start() : this.store.stop()));
    document.addEventListener("keydown", (event) => this.#onKey(event));
  }

  /** How many alarms want somebody. */
  get count() {
    return this.fleet.past ? 0 : this.store.pending.length;
  }

  /** 2: the tag has an alarm, 1: a warning, 0: neither. @param {string} tag */
  rank(tag) {
    return this.fleet.past ? 0 : this.store.rank(tag);
  }

  /** Show ages that grow. */
  update() {
    if (this.store.all.length > 0) this.list.update();
  }

  /** `A` acknowledges the alarms of the selected tag, or leads to the first one. @param {KeyboardEvent} event */
  #onKey(event) {
    if (event.key.toLowerCase() !== "a" || isTyping(event) || event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
    const { selected } = this.choice;
    const own = this.store.pending.filter((alarm) => selected !== null && tagsOf(alarm).includes(selected));
    if (own.length > 0 && this.store.mayWrite) this.#acknowledge(own, "");
    else this.list.focus();
    event.preventDefault();
  }

  /** @param {readonly Alarm[]} alarms @param {string} note */
  #acknowledge(alarms, note) {
    this.changes.attempt(async () => {
      for (const alarm of alarms) await this.store.acknowledge(alarm, note);
      byId("spoken").textContent = t("alarm.spoken", { n: this.store.all.filter(isPending).length });
    });
  }

  /** @param {Alarm} alarm @param {boolean} on */
  async #mute({ event: { data } }, on) {
    const path = data.zone === null ? `event-rules/${encodeURIComponent(data.rule ?? "")}` : `zones/${encodeURIComponent(data.zone)}`;
    const what = t(on ? "alarm.muted_done" : "alarm.unmuted_done", { rule: data.name || data.rule || data.zone || "" });
    await this.changes.editAsIs(what, path, { muted_until_ns: on ? Date.now() * 1e6 + HOUR_NS : null });
  }
}
