/** The steps of a draft on the map, which can be undone until it is saved or discarded. */

/** @template T what a step changes */
export class DraftSteps {
  /** What made the last step. @type {object | string | null} */
  #gesture = null;

  /** @param {import("./undo.js").UndoStack} history @param {string} note says that the draft is not saved
   * @param {{get: () => T, put: (value: T) => void}} draft */
  constructor(history, note, draft) {
    this.history = history;
    this.note = note;
    this.draft = draft;
  }

  /** Keep how to take a change back that is about to be made. Several by one gesture are one step.
   * @param {string} what is done, as a sentence @param {object | string} [gesture] */
  keep(what, gesture = {}) {
    if (gesture === this.#gesture) return;
    this.#gesture = gesture;
    const before = this.draft.get();
    this.history.push({ what, note: this.note, owner: this, back: () => this.#back(before) });
  }

  /** @param {T} value @returns {import("./undo.js").Back} */
  #back(value) {
    const present = this.draft.get();
    this.#gesture = null;
    this.draft.put(value);
    return () => this.#back(present);
  }

  forget() {
    this.#gesture = null;
    this.history.forget(this);
  }
}
