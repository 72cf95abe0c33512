/** Change anchors and tags: only what this page has seen, and undo the last changes. */

import { ChangedMeanwhileError, KeyRequiredError, request, sendChange } from "./access.js";
import { api, getJson } from "./connection.js";

/** @typedef {{value: any, etag: string}} Seen a resource as this page has read it */
/** @typedef {{what: string, path: string, body: object | null, conditions: Record<string, string>}} Undo */
/** @typedef {{what: string, keep: () => void, take: () => void}} Conflict */

const UNDO_STEPS = 20;
const RETRY_MS = 3000;

/** Events: "done" (detail: what), "failed" (detail: a sentence), "conflict" (detail: Conflict), "access". */
export class Changes extends EventTarget {
  /** @type {Undo[]} */
  #undo = [];
  /** @type {"none" | "read" | "write" | "admin"} */
  #scope = "none";
  #retry = 0;

  get mayWrite() {
    return this.#scope === "write" || this.#scope === "admin";
  }

  get mayDelete() {
    return this.#scope === "admin";
  }

  /** Whether this page may undo its last change. */
  get canUndo() {
    const last = this.#undo.at(-1);
    return last !== undefined && (last.body !== null || this.mayDelete);
  }

  /** Request what the key of this page allows, until the service answers. */
  async requestAccess() {
    clearTimeout(this.#retry);
    try {
      this.#scope = (await getJson(api("access"))).scope;
    } catch (error) {
      this.#scope = "none";
      if (!(error instanceof KeyRequiredError)) this.#retry = setTimeout(() => this.requestAccess(), RETRY_MS);
    }
    this.dispatchEvent(new Event("access"));
  }

  /** @param {string} path @returns {Promise<Seen>} */
  async read(path) {
    const response = await request(api(path), {});
    return { value: await response.json(), etag: response.headers.get("etag") ?? "" };
  }

  /** Create a resource that must not exist yet. @param {string} what done, as a sentence @param {string} path @param {object} value */
  async create(what, path, value) {
    return this.#attempt(what, async () => {
      const etag = await sendChange(api(path), "PUT", value, { "if-none-match": "*" });
      return { path, body: null, conditions: { "if-match": etag } };
    });
  }

  /**
   * Change some values of a resource, unless another page has changed it: then ask what to do.
   * @param {string} what @param {string} path @param {object} patch @param {Seen} seen
   * @param {() => void} reread reads the resource again, after a conflict
   * @returns {Promise<boolean>} whether the change was made
   */
  async edit(what, path, patch, seen, reread) {
    const keep = async () => {
      if (await this.edit(what, path, patch, await this.read(path), reread)) reread();
    };
    return this.#attempt(what, async () => {
      const etag = await sendChange(api(path), "PUT", { ...seen.value, ...patch }, { "if-match": seen.etag });
      return { path, body: seen.value, conditions: { "if-match": etag } };
    }, { keep, take: reread });
  }

  /**
   * Delete a resource. @param {string} what @param {string} path
   * @param {{path: string, value: object, conditions: Record<string, string>}} restore what brings it back
   */
  async remove(what, path, restore) {
    return this.#attempt(what, async () => {
      await sendChange(api(path), "DELETE", null, {});
      return { path: restore.path, body: restore.value, conditions: restore.conditions };
    });
  }

  /** Undo the last change, unless somebody has changed the same resource since. */
  async undo() {
    if (!this.canUndo) return;
    const { what, path, body, conditions } = /** @type {Undo} */ (this.#undo.pop());
    try {
      await sendChange(api(path), body === null ? "DELETE" : "PUT", body, conditions);
      this.#tell("done", `Undone: ${what}`);
    } catch (error) {
      const changed = error instanceof ChangedMeanwhileError;
      this.#tell("failed", changed ? `Not undone, because somebody changed it since: ${what}` : sentence(error));
    }
  }

  /** @param {string} what @param {() => Promise<Omit<Undo, "what">>} send @param {Omit<Conflict, "what">} [conflict] */
  async #attempt(what, send, conflict) {
    try {
      this.#undo = [...this.#undo, { what, ...(await send()) }].slice(-UNDO_STEPS);
      this.#tell("done", what);
      return true;
    } catch (error) {
      if (error instanceof ChangedMeanwhileError && conflict) this.#tell("conflict", { what, ...conflict });
      else this.#tell("failed", sentence(error));
      return false;
    }
  }

  /** @param {string} name @param {any} detail */
  #tell(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}

/** @param {unknown} error */
const sentence = (error) => (error instanceof Error ? error.message : String(error));
