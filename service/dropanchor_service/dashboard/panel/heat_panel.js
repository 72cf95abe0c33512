/** The switch of the heat map in the controls of the past, and its legend on the map. */

import { addressValues, writeAddress } from "../data/address.js";
import { age, distance, percent, place } from "../data/format.js";
import { HeatMap, hottest, leftOut } from "../data/heat_map.js";
import { t } from "../i18n/language.js";
import { HeatPainter, heatColour } from "../map/draw_heat_map.js";
import { partOf } from "../page/parts.js";

const STOPS = 7;

export class HeatPanel {
  map = new HeatMap();
  #painter = new HeatPainter();

  /** @param {HTMLElement} button @param {HTMLElement} legend @param {import("../map/map.js").LiveMap} liveMap
   * @param {import("../data/replay.js").Replay} replay @param {import("../page/choice.js").Choice} choice */
  constructor(button, legend, liveMap, replay, choice) {
    this.button = button;
    this.legend = legend;
    this.replay = replay;
    this.choice = choice;
    this.fleet = liveMap.fleet;
    this.#unfold(!matchMedia("(max-width: 800px)").matches); // on a phone it would cover half of the map
    liveMap.underlays.push((scene) => liveMap.layers.isShown("heat") && this.#painter.draw(this.map, scene));
    button.addEventListener("click", () => this.#turn(!this.map.active));
    replay.addEventListener("period", () => this.update());
    choice.addEventListener("change", () => this.map.active && this.update());
    this.map.addEventListener("change", () => {
      this.#paint();
      liveMap.redraw();
    });
    new MutationObserver(() => this.#paint()).observe(document.documentElement, { attributeFilter: ["data-theme"] });
    this.#paint();
  }

  /** Show what the address, the period and the choice of tags say. */
  update() {
    const { from_ms, to_ms } = this.replay;
    if (!addressValues().has("heat") || to_ms <= from_ms) return;
    this.map.show({ from_ms, to_ms, tag: this.choice.selected, group: this.choice.group });
  }

  hide() {
    this.#turn(false);
  }

  /** @param {boolean} on */
  #turn(on) {
    writeAddress({ heat: on ? "1" : null });
    if (on) this.update();
    else this.map.hide();
  }

  #paint() {
    const { active, heat, scale, loading, problem } = this.map;
    this.button.setAttribute("aria-pressed", String(active));
    this.legend.hidden = !active;
    this.legend.setAttribute("aria-busy", String(loading));
    if (!active) return;
    this.#put("who", t("heat.of", { who: this.#who }));
    partOf(this.legend, "scale").hidden = !scale;
    if (scale) scale.marks.forEach((seconds, i) => this.#put(["low", "middle", "high"][i], age(seconds)));
    this.#put("unit", heat && scale ? t("heat.unit", { side: distance(heat.cell_m, 3) }) : "");
    if (problem || (heat && !scale)) this.#unfold(true);
    this.#put("note", problem || (heat ? noteOf(heat) : t("heat.loading")));
    const isDark = document.documentElement.dataset.theme === "dark";
    const stops = Array.from({ length: STOPS }, (_, i) => heatColour(i / (STOPS - 1), isDark));
    partOf(this.legend, "bar").style.backgroundImage = `linear-gradient(to right, ${stops.join(", ")})`;
  }

  /** @param {boolean} is */
  #unfold(is) {
    /** @type {HTMLDetailsElement} */ (partOf(this.legend, "fold")).open = is;
  }

  get #who() {
    const { tag, group } = /** @type {import("../data/heat_map.js").Wanted} */ (this.map.wanted);
    const row = this.fleet.row(tag);
    return tag !== null ? (row >= 0 ? this.fleet.labels[row] : tag) : group || t("heat.all");
  }

  /** @param {string} name @param {string} text */
  #put(name, text) {
    if (partOf(this.legend, name).textContent !== text) partOf(this.legend, name).textContent = text;
  }
}

/** Return where most of the time was spent, and how much is left out. @param {import("../data/heat_map.js").Heat} heat */
function noteOf(heat) {
  const at = hottest(heat);
  const { x, y, seconds } = heat.cells;
  const most = at < 0 ? t("heat.nothing") : t("heat.most", { time: age(seconds[at]), place: place(x[at], y[at], 1) });
  const share = leftOut(heat);
  return share > 0 ? `${most} ${t("heat.left_out", { share: percent(share) })}` : most;
}
