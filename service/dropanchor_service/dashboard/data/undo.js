/** What this page can undo and redo: one stack for everything that a person does on it. */

import { UnreachableError } from "./access.js";

/** @typedef {() => Promise<any> | any} Back takes something back, and returns the Back that does it again */
/**
 * @typedef {object} Step
 * @property {string} what was done, as a sentence
 * @property {Back} back
 * @property {string} [path] of the resource that was changed
 * @property {string} [note] what else to say about it
 * @property {string} [refusal] why it cannot be undone
 * @property {{tag: string, since_ms: number}} [started] the tag that it gave a start, and when on the clock of the page
 * @property {object} [together] the same in all steps that a person did at once, and undoes at once
 * @property {object} [owner] of a step that can be undone only for a while, see `forget`
 */

/** Those that a person did at once count as one. */
const STEPS = 50;

/** How long a message offers to undo. */
export const UNDO_MS = 20_000;

/** Events, with the step as their detail: "done", "undone", "redone", "failed" (with its `error`); and "forgot". */
export class UndoStack extends EventTarget {
  /** @type {Step[]} */
  #done = [];
  /** @type {Step[]} */
  #undone = [];
  /** Ends with the last one asked for: two at once would take back the same step. */
  #turn = Promise.resolve();

  get isEmpty() {
    return this.#done.length + this.#undone.length === 0;
  }

  /** @param {Step} step */
  has(step) {
    return this.#done.includes(step) || this.#undone.includes(step);
  }

  /** Return the last start that was given to a tag here, unless it was taken back. @param {string} tag */
  startOf(tag) {
    return this.#done.findLast(({ started }) => started?.tag === tag)?.started ?? null;
  }

  /** Keep how to take back what was just done. @param {Step} step */
  push(step) {
    this.#undone.length = 0;
    this.#done.push(step);
    while (this.#done.filter(isNotWithBefore).length > STEPS) this.#done.shift();
    this.#tell("done", step);
  }

  /** Take back the last step. */
  undo() {
    return this.#next(() => this.#move(this.#done, this.#undone, "undone"));
  }

  /** Do again what was taken back last. */
  redo() {
    return this.#next(() => this.#move(this.#undone, this.#done, "redone"));
  }

  /** Forget the steps of an owner, because they can no longer be taken back. @param {object} owner */
  forget(owner) {
    for (const steps of [this.#done, this.#undone]) {
      for (const step of steps.filter((one) => one.owner === owner)) drop(steps, step);
    }
    this.dispatchEvent(new Event("forgot"));
  }

  /** @param {() => Promise<void>} move */
  #next(move) {
    this.#turn = this.#turn.then(move);
    return this.#turn;
  }

  /** Undo or redo one step, and those done together with it. One that fails is dropped, so that it is not in the way of earlier ones; but not when
   * the service cannot be reached. @param {Step[]} from @param {Step[]} to @param {string} name */
  async #move(from, to, name) {
    const step = from.at(-1);
    if (!step) return;
    try {
      if (step.refusal) throw new Error(step.refusal);
      const moved = { ...step, back: await step.back() };
      drop(from, step);
      to.push(moved);
      if (step.together && step.together === from.at(-1)?.together) await this.#move(from, to, name);
      else this.#tell(name, moved);
    } catch (error) {
      if (!(error instanceof UnreachableError)) drop(from, step);
      this.#tell("failed", { ...step, error });
    }
  }

  /** @param {string} name @param {Step & {error?: unknown}} detail */
  #tell(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}

/** @param {Step} step @param {number} at @param {readonly Step[]} steps */
const isNotWithBefore = ({ together }, at, steps) => !together || together !== steps[at - 1]?.together;

/** @param {Step[]} steps @param {Step} step which may have been forgotten meanwhile */
function drop(steps, step) {
  const at = steps.indexOf(step);
  if (at >= 0) steps.splice(at, 1);
}
