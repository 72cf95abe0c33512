/** Say what became of a change, and offer to undo it or to settle a conflict. */

import { t } from "../i18n/language.js";

const SHOWN_MS = 12_000;

export class Outcome {
  #timer = 0;

  /** @param {HTMLElement} box @param {import("../data/changes.js").Changes} changes */
  constructor(box, changes) {
    this.box = box;
    this.changes = changes;
    changes.addEventListener("done", (event) => this.#done(detailOf(event)));
    changes.addEventListener("failed", (event) => this.#show(detailOf(event), []));
    changes.addEventListener("conflict", (event) => this.#conflict(detailOf(event)));
  }

  /** @param {string} what */
  #done(what) {
    this.#show(what, this.changes.canUndo ? [[t("outcome.undo"), () => this.changes.undo()]] : []);
    this.#timer = setTimeout(() => (this.box.hidden = true), SHOWN_MS);
  }

  /** @param {import("../data/changes.js").Conflict} conflict */
  #conflict({ what, keep, take }) {
    this.#show(t("outcome.conflict", { what }), [[t("outcome.take"), take], [t("outcome.keep"), keep]]);
  }

  /** @param {string} text @param {[string, () => void][]} choices */
  #show(text, choices) {
    clearTimeout(this.#timer);
    const message = Object.assign(document.createElement("span"), { textContent: text });
    this.box.replaceChildren(message, ...[...choices, /** @type {[string, () => void]} */ ([t("close"), () => {}])].map(([label, act]) => {
      const button = Object.assign(document.createElement("button"), { type: "button", className: "text", textContent: label });
      button.addEventListener("click", () => {
        this.box.hidden = true;
        act();
      });
      return button;
    }));
    this.box.hidden = false;
  }
}

/** @param {Event} event */
const detailOf = (event) => /** @type {CustomEvent} */ (event).detail;
