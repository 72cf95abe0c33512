/** The sound of a new alarm, which a person turns on in the dialog *Display*. */

import { chosen, remember } from "../data/display.js";

const TONES_HZ = [880, 660, 880];
const TONE_S = 0.16;

export class Sound {
  /** How often it was to be heard, for tests and the console. */
  played = 0;
  /** Ids of alarms that were heard or known. @type {Set<string> | null} */
  #known = null;
  /** @type {AudioContext | null} */
  #audio = null;

  /** @param {HTMLInputElement} box */
  constructor(box) {
    this.box = box;
    box.checked = chosen("sound", ["on"]) === "on";
    box.addEventListener("change", () => {
      remember({ sound: box.checked ? "on" : "off" });
      if (box.checked) this.#play();
    });
  }

  /** Sound once for alarms that are new. @param {readonly import("./alarm_store.js").Alarm[]} pending */
  update(pending) {
    const ids = pending.filter(({ severity }) => severity === "alarm").map(({ id }) => id);
    const isNew = this.#known !== null && ids.some((id) => !this.#known?.has(id));
    this.#known = new Set([...(this.#known ?? []), ...ids]);
    if (isNew && this.box.checked) this.#play();
  }

  /** Browsers let a page sound after a click into it; before that, they stay silent. */
  async #play() {
    this.#audio ??= new AudioContext();
    await this.#audio.resume();
    const begin_s = this.#audio.currentTime;
    TONES_HZ.forEach((frequency, i) => {
      const audio = /** @type {AudioContext} */ (this.#audio);
      const tone = new OscillatorNode(audio, { frequency });
      tone.connect(new GainNode(audio, { gain: 0.2 })).connect(audio.destination);
      tone.start(begin_s + i * TONE_S);
      tone.stop(begin_s + (i + 0.8) * TONE_S);
    });
    this.played++;
  }
}
