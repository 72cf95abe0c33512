/** Say what was done, undone or refused, and offer to undo it, to do it again or to settle a conflict. */

import { ChangedMeanwhileError } from "../data/access.js";
import { sentence } from "../data/changes.js";
import { UNDO_MS } from "../data/undo.js";
import { t } from "../i18n/language.js";
import { button, element } from "../page/elements.js";

/** @typedef {import("../data/undo.js").Step} Step @typedef {[string, () => void]} Choice */

export class Outcome {
  #timer = 0;
  /** What the message is about. @type {Step | null} */
  #step = null;
  /** What had the focus before a button here. @type {HTMLElement | null} */
  #from = null;

  /** @param {HTMLElement} box stays in the page, so that screen readers hear what is written to it
   * @param {import("../data/changes.js").Changes} changes */
  constructor(box, changes) {
    this.box = box;
    this.history = changes.history;
    for (const name of ["done", "redone"]) this.history.addEventListener(name, (event) => this.#done(detailOf(event)));
    this.history.addEventListener("undone", (event) => this.#undone(detailOf(event)));
    this.history.addEventListener("failed", (event) => this.#show(whyNot(detailOf(event)), []));
    this.history.addEventListener("forgot", () => this.#step && !this.history.has(this.#step) && this.#clear());
    changes.addEventListener("failed", (event) => this.#show(sentence(detailOf(event)), []));
    changes.addEventListener("conflict", (event) => this.#conflict(detailOf(event)));
    box.addEventListener("focusin", ({ relatedTarget }) => {
      if (relatedTarget instanceof HTMLElement && !box.contains(relatedTarget)) this.#from = relatedTarget;
    });
  }

  /** @param {Step} step */
  #done(step) {
    const { what, note, refusal } = step;
    this.#show([what, note, refusal].filter(Boolean).join(" "), refusal ? [] : [[t("outcome.undo"), () => this.history.undo()]], step);
  }

  /** @param {Step} step */
  #undone(step) {
    this.#show(t("outcome.undone", { what: step.what }), [[t("outcome.redo"), () => this.history.redo()]], step);
  }

  /** @param {import("../data/changes.js").Conflict} conflict */
  #conflict({ what, keep, take }) {
    const then = (/** @type {() => void} */ act) => () => {
      this.#clear();
      act();
    };
    this.#show(t("outcome.conflict", { what }), [[t("outcome.take"), then(take)], [t("outcome.keep"), then(keep)]]);
  }

  /** @param {string} text @param {Choice[]} choices @param {Step | null} [step] of a message that goes by itself */
  #show(text, choices, step = null) {
    clearTimeout(this.#timer);
    const hadFocus = this.box.contains(document.activeElement);
    const buttons = [...choices, /** @type {Choice} */ ([t("close"), () => this.#clear()])].map(([label, act]) => button(label, null, act));
    this.box.replaceChildren(element("span", text), ...buttons);
    this.box.classList.remove("above");
    this.box.classList.toggle("above", isOver(this.box, document.activeElement));
    if (hadFocus) buttons[0].focus();
    this.#step = step;
    if (step) this.#expire();
  }

  /** Leave the message for a while, and longer while somebody is about to use its buttons. */
  #expire() {
    this.#timer = setTimeout(() => (this.box.matches(":hover, :focus-within") ? this.#expire() : this.#clear()), UNDO_MS);
  }

  #clear() {
    clearTimeout(this.#timer);
    const hadFocus = this.box.contains(document.activeElement);
    this.box.replaceChildren();
    this.#step = null;
    if (hadFocus) this.#from?.focus();
  }
}

/** @param {Step & {error: unknown}} step that was not undone or not done again */
const whyNot = ({ what, error }) => (error instanceof ChangedMeanwhileError ? t("outcome.not_undone", { what }) : sentence(error));

/** Return whether the message hides the button that has the focus, such as the corner of a zone.
 * @param {HTMLElement} box @param {Element | null} focused */
function isOver(box, focused) {
  if (!(focused instanceof HTMLButtonElement) || box.contains(focused)) return false;
  const [one, other] = [box.getBoundingClientRect(), focused.getBoundingClientRect()];
  return one.left < other.right && other.left < one.right && one.top < other.bottom && other.top < one.bottom;
}

/** @param {Event} event */
const detailOf = (event) => /** @type {CustomEvent} */ (event).detail;
