/** The list of the latest events, newest first. A click selects the tag and the zone. */

import { retractedBy } from "./event_log.js";
import { clock, fullTime, probability, sentence, why } from "./words.js";
import { t } from "../i18n/language.js";
import { write, writeOrHide } from "../page/parts.js";
import { button, element, line } from "../page/elements.js";

/** @typedef {import("./words.js").ServiceEvent} ServiceEvent */

export class EventList {
  /** @type {Map<string, HTMLElement>} */
  #lines = new Map();

  /** @param {HTMLDetailsElement} box @param {import("./event_log.js").EventLog | import("./found_events.js").FoundEvents} log @param {(event: ServiceEvent) => void} pick */
  constructor(box, log, pick) {
    this.log = log;
    this.pick = pick;
    this.list = /** @type {HTMLElement} */ (box.querySelector("ol"));
    this.newest = /** @type {HTMLElement} */ (box.querySelector('[data-part="newest"]'));
    this.note = /** @type {HTMLElement} */ (box.querySelector('[data-part="note"]'));
    this.more = /** @type {HTMLButtonElement} */ (box.querySelector('[data-part="more"]'));
    this.box = box;
  }

  update() {
    const { events, current, note, none, hasMore } = this.log;
    this.more.hidden = !hasMore;
    const newest = events[0];
    write(this.newest, !current ? t("events.outdated") : newest ? t("events.newest", { time: clock(newest), event: sentence(newest) }) : none);
    this.box.classList.toggle("outdated", !current);
    writeOrHide(this.note, note);
    this.#show(events);
  }

  /** Add and remove lines, so that the line with the focus keeps it. @param {ServiceEvent[]} events newest first */
  #show(events) {
    const wanted = new Set(events.map(({ sequence }) => sequence));
    for (const [sequence, line] of this.#lines) {
      if (wanted.has(sequence)) continue;
      line.remove();
      this.#lines.delete(sequence);
    }
    events.forEach((event, i) => {
      const line = this.#lines.get(event.sequence) ?? this.#line(event);
      if (this.list.children[i] !== line) this.list.insertBefore(line, this.list.children[i] ?? null);
    });
    const retracted = retractedBy(events);
    for (const event of events.filter(({ id }) => retracted.has(id))) this.#strike(event, retracted.get(event.id));
  }

  /** Show that an event is not true. @param {ServiceEvent} event @param {string} [reason] */
  #strike(event, reason) {
    const text = this.#lines.get(event.sequence)?.querySelector("span");
    if (text && !text.querySelector("s")) text.replaceChildren(element("s", sentence(event)), ` ${t("event.retracted", { why: why(reason) })}`);
  }

  /** @param {ServiceEvent} event */
  #line(event) {
    const time = /** @type {HTMLTimeElement} */ (element("time", clock(event)));
    time.dateTime = event.time;
    time.title = fullTime(event.time);
    const pick = button("", null, () => this.pick(event), "");
    pick.append(element("span", sentence(event)), " ", time, " ", element("small", probability(event)));
    const made = line(pick);
    this.#lines.set(event.sequence, made);
    return made;
  }
}
