/** Why the selected tag was where it was at the shown time: who had changed what, what the black box says, and what if not. */

import { request } from "../data/access.js";
import { api, getJson } from "../data/connection.js";
import { words } from "../data/format.js";
import { saveFile } from "../data/save_file.js";
import { STATES, stateNumber } from "../data/states.js";
import { nanoseconds } from "../data/track_reader.js";
import { differences } from "../data/trail.js";
import { t, timeText } from "../i18n/language.js";
import { refusal, said } from "../i18n/said.js";
import { partOf } from "../page/parts.js";
import { WhatIf } from "./what_if.js";
import { button, line } from "../page/elements.js";

const BEFORE_MS = 120_000;
const DAY_MS = 86_400_000;
const MOST = 8;
const KINDS = ["anchor", "site", "tag"];
/** @type {Record<string, string>} */
const INCIDENTS = { rejected: "then.rejected", clock_jump: "then.clock_jump", restart: "then.restart", missing: "then.missing" };

/** @typedef {import("./what_if.js").Cause} Cause */
/** @typedef {{t_ns: number, kind: string, reason: string | null, count: number}} Incident @typedef {import("../data/trail.js").Entry} Entry */

export class Then {
  #asked = ""; // what is shown or under way

  /** The tag and the time whose changes are shown. */
  #listed = "";

  /** @param {HTMLElement} box @param {import("./past_bar.js").PastBar} bar @param {import("../page/choice.js").Choice} choice
   * @param {import("../map/map.js").LiveMap} map @param {import("../data/changes.js").Changes} changes */
  constructor(box, bar, choice, map, changes) {
    this.box = box;
    this.bar = bar;
    this.replay = bar.replay;
    this.choice = choice;
    this.whatIf = new WhatIf(/** @type {HTMLFormElement} */ (partOf(box, "what-if")), bar.replay, choice, map, changes);
    partOf(box, "explain").addEventListener("click", () => this.#explain());
    partOf(box, "save").addEventListener("click", () => this.#save());
    choice.addEventListener("change", () => this.update());
    bar.replay.addEventListener("period", () => this.update());
  }

  update() {
    this.box.hidden = !this.replay.figures.get(this.choice.selected)?.figure;
    this.#say("", []);
    this.whatIf.clear();
    if (!this.box.hidden) this.#list();
  }

  get #tag() {
    return encodeURIComponent(this.choice.selected ?? "");
  }

  async #explain() {
    const at_ms = this.replay.time_ms;
    const asked = (this.#asked = `${this.#tag} ${at_ms}`);
    this.#say(t("then.running"), []);
    try {
      const { pose, past } = await this.#explanation(at_ms);
      if (asked === this.#asked) this.#say(stateText(pose), [...this.#causes(past), ...incidents(past), ...states(past)]);
    } catch (error) {
      if (asked === this.#asked) this.#say(refusal(error), []);
    }
  }

  /** @param {{causes: Cause[]}} past @returns {(string | Node)[][]} */
  #causes = ({ causes }) => causes.map((cause) => [said(cause.text, cause.phrase), " ", button(t("whatif.so"), null, () => this.whatIf.offer(cause))]);

  /** @param {number} at_ms */
  async #explanation(at_ms) {
    const url = api(`tags/${this.#tag}/explain?at=${nanoseconds(at_ms)}&last=1`);
    return (await request(url, {})).json(); // a run takes some seconds
  }

  /** List who changed what of the tag, the anchors and the site in the period and the day before, and mark it on the time line. */
  async #list() {
    const { from_ms, to_ms } = this.replay;
    const tag = this.choice.selected;
    const listed = (this.#listed = `${tag} ${from_ms} ${to_ms}`);
    /** @type {{entries: Entry[]}} */
    const { entries } = await getJson(api(`audit?from=${nanoseconds(to_ms - DAY_MS)}&to=${nanoseconds(to_ms)}&kind=${KINDS.join()}`)).catch(() => ({ entries: [] }));
    if (listed !== this.#listed) return;
    const own = entries.filter(({ kind, item }) => kind !== "tag" || item === tag);
    this.bar.mark("changes", own.map(({ t_ns }) => t_ns / 1e6));
    partOf(this.box, "changes").replaceChildren(...own.slice(0, MOST).map((entry) => this.#change(entry)));
  }

  /** @param {Entry} entry */
  #change(entry) {
    const text = t("then.change", {
      time: timeOf(entry.t_ns),
      who: entry.by.name || t(`trail.by_${entry.by.source}`),
      item: entry.item,
      what: differences(entry.before ?? {}, entry.after ?? {}).map(([name, before, after]) => `${name}: ${JSON.stringify(before) ?? "–"} → ${JSON.stringify(after) ?? "–"}`).join(", "),
    });
    const made = line(button(text, null, () => this.replay.seek(entry.t_ns / 1e6)));
    const other = withoutIt(entry);
    if (other) made.append(" ", button(t("whatif.not"), null, () => this.whatIf.run(other, entry.t_ns / 1e6 - 1000)));
    return made;
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

  /** @param {string} text @param {(string | (string | Node)[])[]} lines */
  #say(text, lines) {
    if (text === "") this.#asked = "";
    partOf(this.box, "answer").textContent = text;
    partOf(this.box, "lines").replaceChildren(...lines.map((parts) => line(...[parts].flat())));
    partOf(this.box, "lines").hidden = lines.length === 0;
  }
}

/** Return what takes a change back; null where a run cannot. @param {Entry} entry */
function withoutIt({ kind, before, after }) {
  if (before === null || after === null || kind === "site") return null;
  if (kind === "anchor") return { anchors: [before] };
  return { settings: Object.fromEntries(differences(before, after).map(([name, value]) => [name, value ?? null])) };
}

/** @param {{state: string, reason: string}} pose */
const stateText = ({ state, reason }) => `${STATES[stateNumber(state)].label}: ${words(reason)}`;

/** Return a line for each thing that happened, with when it did first: a clock jumps once, among hundreds of late samples.
 * @param {{incidents: Incident[]}} past */
function incidents(past) {
  /** @type {Map<string, Incident>} */
  const found = new Map();
  for (const one of past.incidents) {
    const what = `${one.kind} ${one.reason}`;
    found.set(what, { ...one, t_ns: found.get(what)?.t_ns ?? one.t_ns, count: one.count + (found.get(what)?.count ?? 0) });
  }
  return [...found.values()].map(({ t_ns, kind, reason, count }) => t(INCIDENTS[kind], { time: timeOf(t_ns), n: count, reason: reason ? words(reason) : "" }));
}

/** @param {{states: {t_ns: number, state: string, reason: string}[]}} past */
const states = (past) => past.states.slice(-MOST).map((one) => t("then.state", { time: timeOf(one.t_ns), state: stateText(one) }));

/** @param {number} t_ns */
const timeOf = (t_ns) => timeText(t_ns / 1e6, { hour: "2-digit", minute: "2-digit", second: "2-digit" });
