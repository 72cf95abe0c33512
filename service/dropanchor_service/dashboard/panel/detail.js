/** The details of the selected tag. */

import { hasKey } from "../data/access.js";
import { api } from "../data/connection.js";
import { UNKNOWN, accuracy, age, compass, count, floor, height, length, percent, place, speed, turnRate, words } from "../data/format.js";
import { t } from "../i18n/language.js";
import { said } from "../i18n/said.js";
import { AMBIGUOUS } from "../data/states.js";
import { clockText, healthTexts } from "./care.js";
import { HeightPlot, heightsOfMinute } from "./height_plot.js";
import { hintOf } from "./hint.js";
import { applyNorth, isNorthOffered } from "./north.js";
import { Plots } from "./plots.js";
import { showUncertainty } from "./uncertainty.js";
import { symbol } from "../map/symbols.js";
import { partOf, write, writeOrHide } from "../page/parts.js";
import { button, line } from "../page/elements.js";

/** @typedef {import("../data/fleet.js").Fleet} Fleet */

/** For so long a hint names the start that somebody set on this page. */
const START_S = 120;

export class Detail {
  /** Direction of the x axis, counter-clockwise from east. */
  #rotation_rad = 0;
  /** Leave the details. */
  leave = () => this.choice.select(null);
  /** Return the heights of a tag over the period of the past that the page shows. @type {(tag: string) => import("./height_plot.js").Heights | null} */
  heightsInPast = () => null;
  /** How settings are changed; null until the page knows. @type {import("../data/changes.js").Changes | null} */
  changes = null;

  /** @param {HTMLElement} panel @param {Fleet} fleet @param {import("../data/roster.js").Roster} roster
   * @param {import("../page/choice.js").Choice} choice @param {import("../data/evidence.js").Evidence} evidence */
  constructor(panel, fleet, roster, choice, evidence) {
    this.panel = panel;
    this.fleet = fleet;
    this.roster = roster;
    this.choice = choice;
    this.evidence = evidence;
    this.plots = new Plots(partOf(this.panel, "plots"));
    this.heights = new HeightPlot(partOf(this.panel, "heights"));
    this.follow = /** @type {HTMLButtonElement} */ (partOf(this.panel, "follow"));
    this.follow.addEventListener("click", () => (choice.follow = !choice.follow));
    partOf(this.panel, "apply-north").addEventListener("click", () => this.changes && applyNorth(this.changes));
    partOf(this.panel, "close").addEventListener("click", () => this.leave());
    choice.addEventListener("change", () => this.update());
    evidence.addEventListener("change", () => this.#explain());
    this.update();
  }

  /** @param {number} rad */
  set rotation_rad(rad) {
    this.#rotation_rad = rad;
    write(partOf(this.panel, "n-x"), t(rad === 0 ? "figure.x_east" : "table.x"));
    write(partOf(this.panel, "n-y"), t(rad === 0 ? "figure.y_north" : "table.y"));
  }

  update() {
    const row = this.fleet.row(this.choice.selected);
    this.panel.hidden = row < 0;
    if (row < 0) return;
    if (this.fleet.hasPose(row)) this.evidence.request(this.fleet.names[row]);
    this.#head(row);
    this.#numbers(row);
    this.#health(this.fleet.names[row]);
    this.#hypotheses(row);
    if (!this.#explanation) this.#explain();
  }

  get #explanation() {
    return this.evidence.of(this.choice.selected);
  }

  #explain() {
    const row = this.fleet.row(this.choice.selected);
    if (row < 0) return;
    this.plots.update(this.#explanation);
    showUncertainty(partOf(this.panel, "uncertainty"), this.#explanation);
    partOf(this.panel, "apply-north").hidden = !(this.changes?.mayWrite && isNorthOffered(this.#explanation));
    const status = this.#explanation ?? this.roster.of(this.fleet.names[row]);
    countsInto(partOf(this.panel, "samples"), t("tag.used"), status?.samples);
    countsInto(partOf(this.panel, "rejected"), t("tag.rejected"), status?.rejected);
  }

  /** @param {number} row */
  #head(row) {
    const state = this.fleet.style(row);
    const name = this.fleet.names[row];
    this.panel.dataset.state = state.name;
    write(partOf(this.panel, "name"), this.fleet.labels[row]);
    write(partOf(this.panel, "id"), this.fleet.labels[row] === name ? "" : name);
    write(partOf(this.panel, "state"), state.label);
    partOf(this.panel, "symbol").replaceChildren(symbol(state.name).svg);
    const { current, value } = this.fleet;
    const reason = current ? value.reason[row] : null;
    write(partOf(this.panel, "meaning"), state.meaning);
    write(partOf(this.panel, "reason"), reason ? words(reason) : "");
    const hint = current ? this.#withStart(name, state.trusted, hintOf(this.fleet, this.roster, row)) : "";
    writeOrHide(partOf(this.panel, "hint"), hint);
    this.follow.setAttribute("aria-pressed", String(this.choice.follow));
    partOf(this.panel, "json").setAttribute("href", api(`tags/${encodeURIComponent(name)}/pose`).href);
    partOf(this.panel, "json").hidden = hasKey() || this.fleet.past || !this.fleet.hasPose(row); // a link carries no key
  }

  /** Name the start that was set just before in a hint about what came of it. @param {string} tag @param {boolean} trusted @param {string} hint */
  #withStart(tag, trusted, hint) {
    const set = this.changes?.history.startOf(tag);
    const seconds = set ? (performance.now() - set.since_ms) / 1000 : Infinity;
    return hint === "" || trusted || seconds > START_S ? hint : t("tag.hint_after_start", { age: age(seconds), hint });
  }

  /** @param {number} row */
  #numbers(row) {
    const number = (/** @type {keyof Fleet["number"]} */ name) => this.fleet.number[name][row];
    const anchor = this.fleet.value.anchor[row];
    /** @type {Record<string, string>} */
    const texts = {
      x: length(number("x")),
      y: length(number("y")),
      accuracy: accuracy(number("semi_major_m"), number("semi_minor_m")),
      height: height(number("z"), number("z_std_m"), this.fleet.value.z_source[row]),
      floor: floor(this.fleet.value.floor[row], number("floor_probability")),
      heading: compass(number("heading_rad") + this.#rotation_rad),
      speed: speed(number("speed_mps")),
      turn: turnRate(number("yaw_rate_radps")),
      range: length(number("range_m")),
      anchor: anchor ?? UNKNOWN,
      mode: percent(number("p_mode")),
      sight: length(number("sigma_obs_m")),
      age: age(this.fleet.age(row, performance.now())),
      online: !this.fleet.current || this.fleet.past ? UNKNOWN : t(this.fleet.online[row] ? "figure.online" : "figure.offline"),
    };
    for (const [name, value] of Object.entries(texts)) write(partOf(this.panel, `v-${name}`), value);
    partOf(this.panel, "floor").hidden = texts.floor === "";
    const name = this.fleet.names[row];
    this.heights.show(this.fleet.past ? this.heightsInPast(name) : heightsOfMinute(this.#explanation));
  }

  /** @param {string} tag */
  #health(tag) {
    const status = this.roster.of(tag);
    this.#care(tag, status?.needs_care ?? []);
    const box = partOf(this.panel, "health");
    const texts = status?.health ? healthTexts(status.health) : [];
    if (status?.clock_offset) texts.push([t("health.motion_clock"), clockText(status.clock_offset)]);
    const fromMotion = status?.clock_offset?.from_motion;
    if (fromMotion) texts.push([t("health.by_motion"), clockText(fromMotion)]);
    box.hidden = texts.length === 0;
    if (box.dataset.shown === JSON.stringify(texts)) return;
    box.dataset.shown = JSON.stringify(texts);
    box.replaceChildren(...texts.map(([term, text]) => {
      const pair = document.createElement("div");
      pair.append(Object.assign(document.createElement("dt"), { textContent: term }));
      pair.append(Object.assign(document.createElement("dd"), { textContent: text }));
      return pair;
    }));
  }

  /** List what a person should do, with a button where a setting of the tag does it.
   * @param {string} tag @param {import("../data/roster.js").Care[]} cares */
  #care(tag, cares) {
    const list = partOf(this.panel, "care");
    list.hidden = cares.length === 0;
    const mayWrite = this.changes?.mayWrite ?? false;
    const shown = JSON.stringify([tag, cares, mayWrite]);
    if (list.dataset.shown === shown) return;
    list.dataset.shown = shown;
    list.replaceChildren(...cares.map(({ hint, hint_phrase, setting }) => {
      const more = setting && mayWrite ? [" ", this.#acceptButton(tag, setting)] : [];
      return line(said(hint, hint_phrase), ...more);
    }));
  }

  /** @param {string} tag @param {Record<string, string | boolean>} setting */
  #acceptButton(tag, setting) {
    const what = t("care.accepted", { tag, setting: settingText(setting) });
    const path = `tags/${encodeURIComponent(tag)}/settings`;
    return button(t("care.accept", { setting: settingText(setting) }), null, () => this.#accept(what, path, setting), "accept");
  }

  /** @param {string} what @param {string} path @param {Record<string, string | boolean>} setting */
  async #accept(what, path, setting) {
    await this.changes?.edit(what, path, setting, await this.changes.read(path), () => this.update());
  }

  /** @param {number} row */
  #hypotheses(row) {
    const list = partOf(this.panel, "hypotheses");
    const ghosts = this.fleet.state[row] === AMBIGUOUS ? (this.fleet.value.hypotheses[row] ?? []) : [];
    list.hidden = ghosts.length === 0;
    const likely = [...ghosts].sort((a, b) => b.weight - a.weight).slice(0, 6);
    while (list.childElementCount > likely.length) list.lastElementChild?.remove();
    while (list.childElementCount < likely.length) list.append(hypothesisLine());
    likely.forEach((ghost, i) => putHypothesis(list.children[i], ghost));
  }
}

function hypothesisLine() {
  const bar = document.createElement("meter");
  bar.setAttribute("aria-label", t("tag.hypothesis"));
  return line(document.createElement("span"), bar, document.createElement("span"));
}

/** @param {Element} line @param {import("../data/fleet.js").Hypothesis} ghost */
function putHypothesis(line, ghost) {
  const [where, bar, weight] = /** @type {[HTMLElement, HTMLMeterElement, HTMLElement]} */ ([...line.children]);
  write(where, place(ghost.x, ghost.y, 1));
  bar.value = ghost.weight;
  write(weight, percent(ghost.weight));
}

/** @param {HTMLElement} list @param {string} title @param {Record<string, number> | undefined} byName */
function countsInto(list, title, byName) {
  const counts = Object.entries(byName ?? {}).sort((a, b) => b[1] - a[1]);
  fillList(list, counts.length === 0 ? [] : [title, ...counts.map(([name, number]) => `${words(name)} ${count(number)}`)]);
}

/** @param {Record<string, string | boolean>} setting */
const settingText = (setting) => Object.entries(setting).map(([name, value]) => `${name} = ${value}`).join(", ");

/** @param {HTMLElement} list @param {string[]} texts */
function fillList(list, texts) {
  list.hidden = texts.length === 0;
  if (list.textContent === texts.join("")) return;
  list.replaceChildren(...texts.map((text) => line(text)));
}
