/** The list of destinations: where events go, how many wait, what is wrong, and what to do about it. */

import { clock, sentence } from "../zones/words.js";
import { keepLines } from "./lines.js";
import { button, element } from "../page/elements.js";
import { queueWords, whereTo } from "./words.js";
import { t } from "../i18n/language.js";
import { refusal } from "../i18n/said.js";

/** @typedef {import("./words.js").DestinationState} DestinationState */

const LISTED = 20;

export class DestinationList {
  /** What the last action on a destination brought, by its id. @type {Map<string, string>} */
  #answers = new Map();
  /** The destinations whose dead letters are shown, with their text. @type {Map<string, string[]>} */
  #letters = new Map();

  /** @param {HTMLElement} list @param {import("./alert_store.js").AlertStore} store
   * @param {{edit: (id: string) => void, confirm: (question: string, action: string) => Promise<boolean>, isLeaving: (id: string) => boolean}} act */
  constructor(list, store, act) {
    this.list = list;
    this.store = store;
    this.act = act;
  }

  update() {
    const { states, isAdmin } = this.store;
    keepLines(this.list, states.map((state) => {
      const { id } = state.destination;
      const key = JSON.stringify([state, isAdmin, this.act.isLeaving(id), this.#answers.get(id), this.#letters.get(id)]);
      return { key, make: () => this.#line(state) };
    }));
  }

  /** @param {DestinationState} state */
  #line(state) {
    const { destination, dead, problem } = state;
    const { id } = destination;
    const line = element("li", "");
    const words = element("small", queueWords(state));
    words.classList.toggle("failing", dead > 0 || problem !== null);
    line.append(element("strong", id), element("span", whereTo(destination)), words);
    if (problem !== null) line.append(element("p", t("queue.problem", { problem }), "failing"));
    if (this.act.isLeaving(id)) line.append(element("p", t("destination.leaving"), "answer"));
    else if (this.store.isAdmin) line.append(this.#actions(id, dead));
    const answer = this.#answers.get(id);
    if (answer !== undefined) line.append(element("p", answer, "answer"));
    const letters = this.#letters.get(id);
    if (dead > 0 && letters) line.append(this.#letterList(letters));
    return line;
  }

  /** @param {string} id @param {number} dead */
  #actions(id, dead) {
    const row = element("div", "");
    row.append(
      button(t("zones.edit"), t("zones.edit_one", { zone: id }), () => this.act.edit(id)),
      button(t("queue.test"), t("queue.test_one", { id }), () => this.#test(id)),
    );
    if (dead > 0) {
      row.append(
        button(t("queue.show"), t("queue.show_one", { id }), () => this.#show(id)),
        button(t("queue.retry"), t("queue.retry_one", { id }), () => this.#settle(id, "retry")),
        button(t("queue.drop"), t("queue.drop_one", { id }), () => this.#drop(id)),
      );
    }
    return row;
  }

  /** @param {string[]} letters */
  #letterList(letters) {
    const list = element("ol", "");
    list.setAttribute("aria-label", t("queue.letters"));
    list.append(...letters.map((text) => element("li", text)));
    return list;
  }

  /** @param {string} id */
  async #test(id) {
    this.#answer(id, t("queue.testing"));
    await this.#attempt(id, async () => {
      const { delivered, detail } = await this.store.test(id);
      this.#answer(id, t(delivered ? "queue.delivered" : "queue.not_delivered", { detail }));
    });
  }

  /** @param {string} id */
  async #show(id) {
    await this.#attempt(id, async () => {
      const letters = await this.store.deadLetters(id);
      const more = letters.length > LISTED ? [t("queue.more")] : [];
      this.#letters.set(id, [...letters.slice(0, LISTED).map(({ event, reason }) => t("queue.letter", { time: clock(event), event: sentence(event), reason })), ...more]);
      this.update();
    });
  }

  /** @param {string} id @param {"retry" | "drop"} what */
  async #settle(id, what) {
    await this.#attempt(id, async () => {
      this.#letters.delete(id);
      this.#answers.delete(id);
      await this.store.settle(id, what);
    });
  }

  /** @param {string} id */
  async #drop(id) {
    if (await this.act.confirm(t("queue.drop_question", { id }), t("queue.drop"))) await this.#settle(id, "drop");
  }

  /** @param {string} id @param {() => Promise<void>} act */
  async #attempt(id, act) {
    try {
      await act();
    } catch (error) {
      this.#answer(id, refusal(error));
    }
  }

  /** @param {string} id @param {string} text */
  #answer(id, text) {
    this.#answers.set(id, text);
    this.update();
  }
}
