/** The list of alarms above the tags: what is wrong, since when, who knows of it, and what to do. */

import { isMuted, isPending } from "./alarm_store.js";
import { keepLines } from "../alerts/lines.js";
import { button, element } from "../page/elements.js";
import { age } from "../data/format.js";
import { t } from "../i18n/language.js";
import { instead, write } from "../page/parts.js";
import { clock, fullTime, sentence } from "../zones/words.js";

/** @typedef {import("./alarm_store.js").Alarm} Alarm */
/** @typedef {{pick: (alarm: Alarm) => void, acknowledge: (alarm: Alarm, note: string) => void, mute: (alarm: Alarm, on: boolean) => void}} Acts */

/** More would be no list that a person reads; those that want somebody come first. */
const MOST = 100;

export class AlarmList {
  /** @param {HTMLElement} box @param {import("./alarm_store.js").AlarmStore} store @param {Acts} acts */
  constructor(box, store, acts) {
    this.box = box;
    this.store = store;
    this.acts = acts;
    this.list = /** @type {HTMLElement} */ (box.querySelector("ul"));
  }

  /** Show the alarms, those first that want somebody, and then those that go on. */
  update() {
    const shown = [...this.store.all].sort((a, b) => urgency(b) - urgency(a)).slice(0, MOST);
    this.box.hidden = shown.length === 0;
    keepLines(this.list, shown.map((alarm) => ({ key: this.#key(alarm), make: () => this.#line(alarm) })));
    shown.forEach((alarm, i) => write(/** @type {HTMLElement} */ (this.list.children[i].querySelector("time")), when(alarm)));
  }

  /** Go to the first alarm that wants somebody. */
  focus() {
    /** @type {HTMLElement | null} */ (this.list.querySelector('[data-part="acknowledge"]'))?.focus();
  }

  /** What changes a line; its age does not, so that a note can be typed meanwhile. @param {Alarm} alarm */
  #key(alarm) {
    return JSON.stringify([alarm.id, alarm.acknowledged, alarm.over_ns, isMuted(alarm), this.store.mayWrite]);
  }

  /** @param {Alarm} alarm */
  #line(alarm) {
    const line = element("li", "");
    const what = button("", "", () => this.acts.pick(alarm));
    what.removeAttribute("aria-label");
    what.className = "what";
    what.append(element("strong", t(`severity.word_${alarm.severity}`)), element("span", sentence(alarm.event)), Object.assign(element("time", when(alarm)), { title: fullTime(alarm.began_ns / 1e6) }));
    line.append(what);
    line.dataset.severity = alarm.severity;
    line.dataset.wants = String(isPending(alarm));
    const { acknowledged } = alarm;
    if (acknowledged) line.append(element("p", t("alarm.seen", { who: acknowledged.by.name || t("alarm.somebody"), time: clock({ time: acknowledged.t_ns / 1e6 }), note: acknowledged.note }).trim()));
    if (this.store.mayWrite) line.append(this.#buttons(alarm));
    return line;
  }

  /** @param {Alarm} alarm */
  #buttons(alarm) {
    const form = /** @type {HTMLFormElement} */ (element("form", ""));
    const note = Object.assign(document.createElement("input"), { name: "note", maxLength: 500, placeholder: t("alarm.note"), autocomplete: "off" });
    const [about, muted] = [sentence(alarm.event), isMuted(alarm)];
    note.setAttribute("aria-label", t("alarm.note_one", { alarm: about }));
    form.append(note);
    const seen = button(t(alarm.acknowledged ? "alarm.note_again" : "alarm.acknowledge"), t(alarm.acknowledged ? "alarm.note_again_one" : "alarm.acknowledge_one", { alarm: about }), () => {});
    seen.type = "submit";
    if (isPending(alarm)) seen.dataset.part = "acknowledge";
    form.append(seen);
    const { rule, zone, name } = alarm.event.data;
    if (alarm.over_ns === null) form.append(button(t(muted ? "alarm.unmute" : "alarm.mute"), t(muted ? "alarm.unmute_one" : "alarm.mute_one", { rule: name || rule || zone || "" }), () => this.acts.mute(alarm, !muted)));
    instead(form, "submit", () => this.acts.acknowledge(alarm, note.value.trim()));
    return form;
  }
}

/** Return how soon somebody should look. @param {Alarm} alarm */
const urgency = (alarm) => (isPending(alarm) ? 4 : alarm.over_ns === null ? 2 : 0) + Number(alarm.severity === "alarm");

/** Return since when an alarm lasts, or how long it has lasted. @param {Alarm} alarm */
function when(alarm) {
  const [began_ms, end_ms] = [alarm.began_ns / 1e6, alarm.over_ns === null ? Date.now() : alarm.over_ns / 1e6];
  const words = { time: clock({ time: began_ms }), age: age(Math.max(0, end_ms - began_ms) / 1000) };
  if (alarm.over_ns !== null) return t("alarm.over", words);
  return isMuted(alarm) ? t("alarm.muted", { ...words, until: clock({ time: (alarm.muted_until_ns ?? 0) / 1e6 }) }) : t("alarm.since", words);
}
