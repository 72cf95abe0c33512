/** The controls of the past: which period, when in it, how fast, and a clear note that this is not the present. */

import { HOUR_MS, LONGEST_MS, QUICK, dayOf, gapAt, quickPeriod, stripPath } from "../data/periods.js";
import { timeOf, wallDate, wallTime } from "../data/time_zone.js";
import { SPEEDS } from "../data/replay.js";
import { decimal, t, timeText } from "../i18n/language.js";
import { instead, partOf, write } from "../page/parts.js";

/** A shorter gap is not worth a sentence. */
const GAP_MS = 60_000;

/** @typedef {import("../data/replay.js").Replay} Replay */

export class PastBar extends EventTarget {
  #refusal = ""; // what is wrong with the period that was chosen last

  /** @param {HTMLFormElement} bar @param {Replay} replay @param {import("../data/stored_times.js").StoredTimes} times */
  constructor(bar, replay, times) {
    super();
    this.bar = bar;
    this.replay = replay;
    this.times = times;
    this.heatButton = partOf(this.bar, "heat");
    this.figuresButton = partOf(this.bar, "figures");
    this.slider = /** @type {HTMLInputElement} */ (partOf(this.bar, "slider"));
    this.speed = /** @type {HTMLSelectElement} */ (partOf(this.bar, "speed"));
    this.speed.append(...SPEEDS.map((speed) => new Option(`× ${decimal(speed, 0, 1)}`, String(speed), speed === 1)));
    instead(bar, "submit", () => this.#choose());
    partOf(this.bar, "play").addEventListener("click", () => replay.play(!replay.playing));
    partOf(this.bar, "leave").addEventListener("click", () => this.dispatchEvent(new Event("leave")));
    this.slider.addEventListener("input", () => replay.seek(replay.from_ms + Number(this.slider.value) * 1000));
    this.speed.addEventListener("change", () => (replay.speed = Number(this.speed.value)));
    for (const choice of QUICK) partOf(this.bar, choice).addEventListener("click", () => this.#open(quickPeriod(choice, Date.now())));
    partOf(this.bar, "day").addEventListener("change", () => this.#chooseDay());
    partOf(this.bar, "other").addEventListener("click", () => this.#unfold());
    replay.addEventListener("period", () => this.#showPeriod());
    times.addEventListener("change", () => this.#showStretches());
    for (const name of ["time", "state"]) replay.addEventListener(name, () => this.update());
  }

  /** Whether playing leaves out what is not worth seeing. */
  get skips() {
    return this.#input("skip").checked;
  }

  /** Offer a period when none was chosen: the last hour. @param {number} end_ms */
  suggest(end_ms) {
    this.#write("from", end_ms - HOUR_MS);
    this.#write("to", end_ms);
  }

  /** Say why there is nothing to show. @param {string} text */
  explain(text) {
    write(partOf(this.bar, "problem"), text);
  }

  update() {
    const { replay } = this;
    const seconds = Math.round((replay.time_ms - replay.from_ms) / 1000);
    if (Number(this.slider.value) !== seconds) this.slider.value = String(seconds);
    this.slider.setAttribute("aria-valuetext", localTime(replay.time_ms));
    write(partOf(this.bar, "time"), localTime(replay.time_ms));
    partOf(this.bar, "time").setAttribute("datetime", new Date(replay.time_ms).toISOString());
    const play = partOf(this.bar, "play");
    play.setAttribute("aria-label", t(replay.playing ? "past.pause" : "past.play"));
    play.title = t(replay.playing ? "past.pause_key" : "past.play_key");
    play.dataset.playing = String(replay.playing);
    this.speed.value = String(replay.speed);
    this.bar.setAttribute("aria-busy", String(replay.loading));
    const isDone = !replay.loading && replay.problem === "" && replay.isLoaded;
    const nothing = isDone && replay.figures.size === 0;
    this.explain(this.#refusal || (nothing ? this.#nothing() : replay.problem));
    write(partOf(this.bar, "gap"), isDone && !nothing ? this.#gap() : "");
  }

  /** Say that there is nothing, and when there is something. */
  #nothing() {
    const { whole } = this.times;
    const all = whole ? t("past.whole", { from: localTime(whole.from_ms), to: localTime(whole.to_ms) }) : "";
    return `${t("past.nothing")} ${all}`.trim();
  }

  /** Say that no pose is stored for a while around the shown time. */
  #gap() {
    const gap = this.times.stretches && gapAt(this.times.stretches, this.replay, this.replay.time_ms);
    if (!gap || gap.to_ms - gap.from_ms < GAP_MS) return "";
    const isOneDay = wallDate(gap.from_ms) === wallDate(gap.to_ms);
    const short = (/** @type {number} */ time_ms) => timeText(time_ms, { weekday: isOneDay ? undefined : "short", hour: "2-digit", minute: "2-digit" });
    return t("past.gap", { from: short(gap.from_ms), to: short(gap.to_ms) });
  }

  #showStretches() {
    const { stretches } = this.times;
    partOf(this.bar, "strip").toggleAttribute("hidden", stretches === null);
    partOf(this.bar, "stored").setAttribute("d", stretches ? stripPath(stretches, this.replay) : "");
    this.update();
  }

  /** Mark times on the strip below the slider. @param {"events" | "changes"} what @param {number[]} times ms */
  mark(what, times) {
    const shown_ms = (this.replay.to_ms - this.replay.from_ms) / 250; // less would not be seen
    partOf(this.bar, what).setAttribute("d", stripPath(times.map((time_ms) => ({ from_ms: time_ms, to_ms: time_ms + shown_ms })), this.replay));
  }

  #showPeriod() {
    this.#write("from", this.replay.from_ms);
    this.#write("to", this.replay.to_ms);
    this.slider.max = String(Math.round((this.replay.to_ms - this.replay.from_ms) / 1000));
    this.update();
  }

  #choose() {
    const [from_ms, to_ms] = ["from", "to"].map((name) => timeOf(this.#input(name).value));
    const isRight = to_ms > from_ms && to_ms - from_ms <= LONGEST_MS;
    if (isRight) this.#open({ from_ms, to_ms });
    else this.#refuse(t("past.order"));
  }

  #chooseDay() {
    const day = dayOf(this.#input("day").value, Date.now());
    if (day) this.#open(day);
    else if (this.#input("day").value !== "") this.#refuse(t("past.no_day"));
  }

  /** Say what is wrong with a chosen period, until another one is opened. @param {string} text */
  #refuse(text) {
    this.#refusal = text;
    this.update();
  }

  /** Show or hide the start and the end, which a phone has no room for. */
  #unfold() {
    const isOpen = this.bar.classList.toggle("unfolded");
    partOf(this.bar, "other").setAttribute("aria-expanded", String(isOpen));
  }

  /** @param {import("../data/periods.js").Period} period */
  #open({ from_ms, to_ms }) {
    this.#refusal = "";
    this.replay.open(from_ms, to_ms);
  }

  /** @param {string} name @param {number} time_ms */
  #write(name, time_ms) {
    this.#input(name).value = wallTime(time_ms);
  }

  /** @param {string} name */
  #input(name) {
    return /** @type {HTMLInputElement} */ (partOf(this.bar, name));
  }
}

/** Return a time as people here write it, with its zone. @param {number} time_ms */
export const localTime = (time_ms) => timeText(time_ms, {
  weekday: "short", day: "numeric", month: "short", year: "numeric", hour: "2-digit", minute: "2-digit", second: "2-digit", timeZoneName: "short",
});
