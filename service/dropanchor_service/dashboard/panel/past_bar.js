/** The controls of the past: which period, when in it, how fast, and a clear note that this is not the present. */

import { SPEEDS } from "../data/replay.js";
import { decimal, t, timeText } from "../i18n/language.js";

const HOUR_MS = 3_600_000;

/** @typedef {import("../data/replay.js").Replay} Replay */

export class PastBar extends EventTarget {
  /** @param {HTMLFormElement} bar @param {Replay} replay */
  constructor(bar, replay) {
    super();
    this.bar = bar;
    this.replay = replay;
    this.heatButton = this.#part("heat");
    this.figuresButton = this.#part("figures");
    this.slider = /** @type {HTMLInputElement} */ (this.#part("slider"));
    this.speed = /** @type {HTMLSelectElement} */ (this.#part("speed"));
    this.speed.append(...SPEEDS.map((speed) => new Option(`× ${decimal(speed, 0, 1)}`, String(speed), speed === 1)));
    bar.addEventListener("submit", (event) => this.#choose(event));
    this.#part("play").addEventListener("click", () => replay.play(!replay.playing));
    this.#part("leave").addEventListener("click", () => this.dispatchEvent(new Event("leave")));
    this.slider.addEventListener("input", () => replay.seek(replay.from_ms + Number(this.slider.value) * 1000));
    this.speed.addEventListener("change", () => (replay.speed = Number(this.speed.value)));
    replay.addEventListener("period", () => this.#showPeriod());
    for (const name of ["time", "state"]) replay.addEventListener(name, () => this.update());
  }

  /** Offer a period when none was chosen: the last hour. @param {number} end_ms */
  suggest(end_ms) {
    this.#write("from", end_ms - HOUR_MS);
    this.#write("to", end_ms);
  }

  /** Say why there is nothing to show. @param {string} text */
  explain(text) {
    put(this.#part("problem"), text);
  }

  update() {
    const { replay } = this;
    const seconds = Math.round((replay.time_ms - replay.from_ms) / 1000);
    if (Number(this.slider.value) !== seconds) this.slider.value = String(seconds);
    this.slider.setAttribute("aria-valuetext", localTime(replay.time_ms));
    put(this.#part("time"), localTime(replay.time_ms));
    this.#part("time").setAttribute("datetime", new Date(replay.time_ms).toISOString());
    const play = this.#part("play");
    play.setAttribute("aria-label", t(replay.playing ? "past.pause" : "past.play"));
    play.title = t(replay.playing ? "past.pause_key" : "past.play_key");
    play.dataset.playing = String(replay.playing);
    this.speed.value = String(replay.speed);
    this.bar.setAttribute("aria-busy", String(replay.loading));
    const nothing = !replay.loading && replay.problem === "" && replay.isLoaded && replay.figures.size === 0;
    this.explain(nothing ? t("past.nothing") : replay.problem);
  }

  #showPeriod() {
    this.#write("from", this.replay.from_ms);
    this.#write("to", this.replay.to_ms);
    this.slider.max = String(Math.round((this.replay.to_ms - this.replay.from_ms) / 1000));
    this.update();
  }

  /** @param {Event} event */
  #choose(event) {
    event.preventDefault();
    const [from_ms, to_ms] = ["from", "to"].map((name) => new Date(this.#input(name).value).getTime());
    const isRight = to_ms > from_ms && to_ms - from_ms <= 31 * 24 * HOUR_MS;
    if (isRight) this.replay.open(from_ms, to_ms);
    else this.explain(t("past.order"));
  }

  /** @param {string} name @param {number} time_ms */
  #write(name, time_ms) {
    const local = new Date(time_ms - new Date(time_ms).getTimezoneOffset() * 60_000);
    this.#input(name).value = local.toISOString().slice(0, 19);
  }

  /** @param {string} name */
  #input(name) {
    return /** @type {HTMLInputElement} */ (this.#part(name));
  }

  /** @param {string} name */
  #part(name) {
    return /** @type {HTMLElement} */ (this.bar.querySelector(`[data-part="${name}"]`));
  }
}

/** Return a time as people here write it, with its zone. @param {number} time_ms */
export const localTime = (time_ms) => timeText(time_ms, {
  weekday: "short", day: "numeric", month: "short", year: "numeric", hour: "2-digit", minute: "2-digit", second: "2-digit", timeZoneName: "short",
});

/** @param {HTMLElement} element @param {string} text */
function put(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
