/** What the selected tag did in the shown period, and its track as a file. */

import { RefusedError } from "../data/access.js";
import { api } from "../data/connection.js";
import { UNKNOWN, age, count, distance, speed } from "../data/format.js";
import { t } from "../i18n/language.js";
import { saveFile } from "../data/save_file.js";
import { nanoseconds } from "../data/track_reader.js";
import { isSi } from "../data/units.js";
import { partOf } from "../page/parts.js";

const GEOREFERENCED = ["geojson", "gpx", "kml"];

export class PastFigures {
  isGeoreferenced = false;

  /** @param {HTMLElement} box @param {import("../data/replay.js").Replay} replay @param {import("../page/choice.js").Choice} choice */
  constructor(box, replay, choice) {
    this.box = box;
    this.replay = replay;
    this.choice = choice;
    for (const button of box.querySelectorAll("button")) {
      button.addEventListener("click", () => this.#save(button.dataset.format ?? "csv"));
    }
    partOf(this.box, "si").hidden = isSi;
    choice.addEventListener("change", () => this.update());
    replay.addEventListener("period", () => this.update());
  }

  /** Whether the site has a georeference, without which there are no latitudes and longitudes. @param {boolean} is */
  set georeferenced(is) {
    this.isGeoreferenced = is;
    for (const button of this.box.querySelectorAll("button")) button.disabled = !is && GEOREFERENCED.includes(button.dataset.format ?? "");
    partOf(this.box, "no-georeference").hidden = is;
  }

  update() {
    const figure = this.replay.figures.get(this.choice.selected)?.figure;
    this.box.hidden = !figure;
    partOf(this.box, "answer").textContent = "";
    if (!figure) return;
    const texts = {
      distance: distance(figure.distance_m, 4),
      tracked: age(figure.tracked_s),
      mean: speed(figure.mean_speed_mps),
      max: speed(figure.max_speed_mps),
      poses: count(figure.poses),
    };
    for (const [name, text] of Object.entries(texts)) partOf(this.box, name).textContent = text || UNKNOWN;
  }

  /** Save the whole track. @param {string} format */
  async #save(format) {
    const tag = this.choice.selected ?? "";
    const url = api(`tags/${encodeURIComponent(tag)}/track/file`);
    url.search = new URLSearchParams({
      format, from: nanoseconds(this.replay.from_ms), to: nanoseconds(this.replay.to_ms),
    }).toString();
    partOf(this.box, "answer").textContent = t("figures.preparing");
    try {
      await saveFile(url, `${tag}.${format}`);
      partOf(this.box, "answer").textContent = t("figures.saved", { file: `${tag}.${format}` });
    } catch (error) {
      const lacks = format === "parquet" && error instanceof RefusedError;
      partOf(this.box, "answer").textContent = t(lacks ? "figures.no_parquet" : "figures.failed");
    }
  }
}
