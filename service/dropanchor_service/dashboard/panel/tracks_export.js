/** Save the tracks of the selected tags as one file: those of the shown period, or of the last minutes and hours. */

import { readJoined } from "../data/joined_tracks.js";
import { saveContent } from "../data/save_file.js";
import { t } from "../i18n/language.js";
import { instead } from "../page/parts.js";

const TYPES = { csv: "text/csv", geojson: "application/geo+json" };

export class TracksExport {
  /** @param {HTMLFormElement} form @param {import("../page/choice.js").Choice} choice @param {import("../page/past.js").Past} past */
  constructor(form, choice, past) {
    this.form = form;
    this.choice = choice;
    this.past = past;
    instead(form, "submit", (event) => this.#save(/** @type {HTMLButtonElement | null} */ (/** @type {SubmitEvent} */ (event).submitter)?.value === "geojson" ? "geojson" : "csv"));
    choice.addEventListener("change", () => this.#say(""));
  }

  update() {
    const list = /** @type {HTMLSelectElement} */ (this.form.elements.namedItem("seconds"));
    /** @type {HTMLElement} */ (list.parentElement).hidden = this.past.active; // the shown period is exported
    const geojson = /** @type {HTMLButtonElement} */ (this.form.querySelector("[value=geojson]"));
    geojson.disabled = !this.past.figures.isGeoreferenced;
    geojson.title = geojson.disabled ? t("figures.no_georeference") : "";
  }

  /** @returns {[number, number]} ms */
  get #period() {
    if (this.past.active) return [this.past.replay.from_ms, this.past.replay.to_ms];
    const list = /** @type {HTMLSelectElement} */ (this.form.elements.namedItem("seconds"));
    return [Date.now() - Number(list.value) * 1000, Date.now()];
  }

  /** @param {"csv" | "geojson"} format */
  async #save(format) {
    const tags = this.choice.several;
    const file = `tracks.${format}`;
    try {
      const content = await readJoined(tags, ...this.#period, format, (done) => this.#say(t("several.preparing", { done, all: tags.length })));
      saveContent(new Blob([content], { type: TYPES[format] }), file);
      this.#say(t("figures.saved", { file }));
    } catch {
      this.#say(t("figures.failed"));
    }
  }

  /** @param {string} text */
  #say(text) {
    /** @type {HTMLElement} */ (this.form.querySelector("[role=status]")).textContent = text;
  }
}
