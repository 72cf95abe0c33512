/** Why the selected tag was where it was at the shown time: what the black box says, and who had changed what. */

import { request } from "../data/access.js";
import { api, getJson } from "../data/connection.js";
import { words } from "../data/format.js";
import { saveFile } from "../data/save_file.js";
import { STATES, stateNumber } from "../data/states.js";
import { nanoseconds } from "../data/track_reader.js";
import { differences } from "../data/trail.js";
import { t, timeText } from "../i18n/language.js";
import { refusal } from "../i18n/said.js";
import { partOf } from "../page/parts.js";

const BEFORE_MS = 120_000;
const DAY_MS = 86_400_000;
const MOST = 8;
const KINDS = ["anchor", "site", "tag"];
/** @type {Record<string, string>} */
const INCIDENTS = { rejected: "then.rejected", clock_jump: "then.clock_jump", restart: "then.restart", missing: "then.missing" };

/** @typedef {{t_ns: number, kind: string, reason: string | null, count: number}} Incident */

export class Then {
  #asked = ""; // what is shown or under way

  /** @param {HTMLElement} box @param {import("../data/replay.js").Replay} replay @param {import("../page/choice.js").Choice} choice */
  constructor(box, replay, choice) {
    this.box = box;
    this.replay = replay;
    this.choice = choice;
    partOf(box, "explain").addEventListener("click", () => this.#explain());
    partOf(box, "save").addEventListener("click", () => this.#save());
    choice.addEventListener("change", () => this.update());
    replay.addEventListener("period", () => this.update());
  }

  update() {
    this.box.hidden = !this.replay.figures.get(this.choice.selected)?.figure;
    this.#say("", []);
  }

  get #tag() {
    return encodeURIComponent(this.choice.selected ?? "");
  }

  async #explain() {
    const at_ms = this.replay.time_ms;
    const asked = (this.#asked = `${this.#tag} ${at_ms}`);
    this.#say(t("then.running"), []);
    try {
      const [explanation, trail] = await Promise.all([this.#explanation(at_ms), this.#trail(at_ms)]);
      if (asked === this.#asked) this.#say(stateText(explanation.pose), [...incidents(explanation.past), ...states(explanation.past), ...this.#changes(trail)]);
    } catch (error) {
      if (asked === this.#asked) this.#say(refusal(error), []);
    }
  }

  /** @param {number} at_ms */
  async #explanation(at_ms) {
    const url = api(`tags/${this.#tag}/explain?at=${nanoseconds(at_ms)}&last=1`);
    return (await request(url, {})).json(); // a run takes some seconds
  }

  /** @param {number} at_ms */
  #trail(at_ms) {
    return getJson(api(`audit?from=${nanoseconds(at_ms - DAY_MS)}&to=${nanoseconds(at_ms)}&kind=${KINDS.join()}`));
  }

  /** @param {{entries: import("../data/trail.js").Entry[]}} trail */
  #changes({ entries }) {
    return entries.filter(({ kind, item }) => kind !== "tag" || item === this.choice.selected).slice(0, MOST).map((entry) => t("then.change", {
      time: timeOf(entry.t_ns),
      who: entry.by.name || t(`trail.by_${entry.by.source}`),
      item: entry.item,
      what: differences(entry.before ?? {}, entry.after ?? {}).map(([name, before, after]) => `${name}: ${JSON.stringify(before) ?? "–"} → ${JSON.stringify(after) ?? "–"}`).join(", "),
    }));
  }

  async #save() {
    const to_ms = this.replay.time_ms;
    const file = `${this.choice.selected}.mcap`;
    try {
      await saveFile(api(`tags/${this.#tag}/samples?from=${nanoseconds(to_ms - BEFORE_MS)}&to=${nanoseconds(to_ms)}`), file);
      this.#say(t("figures.saved", { file }), []);
    } catch (error) {
      this.#say(refusal(error), []);
    }
  }

  /** @param {string} text @param {string[]} lines */
  #say(text, lines) {
    if (text === "") this.#asked = "";
    partOf(this.box, "answer").textContent = text;
    partOf(this.box, "lines").replaceChildren(...lines.map((line) => Object.assign(document.createElement("li"), { textContent: line })));
    partOf(this.box, "lines").hidden = lines.length === 0;
  }
}

/** @param {{state: string, reason: string}} pose */
const stateText = ({ state, reason }) => `${STATES[stateNumber(state)].label}: ${words(reason)}`;

/** @param {{incidents: Incident[]}} past */
const incidents = (past) => past.incidents.slice(-MOST).map(({ t_ns, kind, reason, count }) => (
  t(INCIDENTS[kind], { time: timeOf(t_ns), n: count, reason: reason ? words(reason) : "" })
));

/** @param {{states: {t_ns: number, state: string, reason: string}[]}} past */
const states = (past) => past.states.slice(-MOST).map((one) => t("then.state", { time: timeOf(one.t_ns), state: stateText(one) }));

/** @param {number} t_ns */
const timeOf = (t_ns) => timeText(t_ns / 1e6, { hour: "2-digit", minute: "2-digit", second: "2-digit" });
