/** Change what the service holds: only what this page has seen, and so that it can be undone. */

import { ChangedMeanwhileError, KeyRequiredError, request, sendChange, UnreachableError } from "./access.js";
import { api, getJson } from "./connection.js";
import { UNDO_MS, UndoStack } from "./undo.js";
import { t } from "../i18n/language.js";
import { refusal } from "../i18n/said.js";

/** @typedef {{value: any, etag: string}} Seen a resource as this page has read it */
/** @typedef {Partial<import("./undo.js").Step>} More of the step that undoes a change */
/** @typedef {{what: string, keep: () => void, take: () => void}} Conflict */

const RETRY_MS = 3000;

/** Events: "done" (detail: the path of what was changed), "failed" (detail: the error), "conflict" (detail: Conflict), "access". */
export class Changes extends EventTarget {
  history = new UndoStack();
  /** The deletions that wait until nobody can undo them any longer: what sends each, by its path. @type {Map<string, () => void>} */
  #leaving = new Map();
  /** @type {"none" | "read" | "write" | "admin"} */
  #scope = "none";
  #retry = 0;

  constructor() {
    super();
    globalThis.addEventListener?.("pagehide", () => [...this.#leaving.values()].forEach((send) => send()));
  }

  get mayWrite() {
    return this.#scope === "write" || this.#scope === "admin";
  }

  get mayDelete() {
    return this.#scope === "admin";
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
    const response = await request(api(path), {}).catch((error) => {
      throw error instanceof TypeError ? new UnreachableError("The service cannot be reached.") : error;
    });
    return { value: await response.json(), etag: response.headers.get("etag") ?? "" };
  }

  /** Create a resource that must not exist yet. @param {string} what done, as a sentence @param {string} path @param {object} value */
  create(what, path, value) {
    return this.#attempt(what, () => this.apply(what, path, { value: null, etag: "" }, value));
  }

  /**
   * Change some values of a resource, unless another page has changed it: then ask what to do.
   * @param {string} what @param {string} path @param {object} patch @param {Seen} seen
   * @param {() => void} reread reads the resource again, after a conflict @param {More} [more]
   * @returns {Promise<boolean>} whether the change was made
   */
  edit(what, path, patch, seen, reread, more) {
    const keep = async () => {
      if (await this.edit(what, path, patch, await this.read(path), reread, more)) reread();
    };
    return this.#attempt(what, () => this.apply(what, path, seen, { ...seen.value, ...patch }, more), { keep, take: reread });
  }

  /** Change some values of a resource as it is now. @param {string} what @param {string} path @param {object} patch @param {More} [more] */
  editAsIs(what, path, patch, more) {
    return this.#attempt(what, async () => {
      const seen = await this.read(path);
      await this.apply(what, path, seen, { ...seen.value, ...patch }, more);
    });
  }

  /** Do something, and tell when it fails. @param {() => Promise<void>} send */
  attempt(send) {
    return this.#attempt("", send);
  }

  /** Delete a resource as it is now. @param {string} what @param {string} path */
  remove(what, path) {
    return this.#attempt(what, async () => this.apply(what, path, await this.read(path), null));
  }

  /**
   * Bring a resource into another state, and keep how to undo that. Throws as `sendChange` does.
   * @param {string} what @param {string} path @param {Seen} seen value null: it must not exist yet
   * @param {object | null} value null: delete it @param {More} [more]
   */
  async apply(what, path, seen, value, more = {}) {
    const back = await this.#swap(path, seen.value, value, seen.etag);
    const isFinal = seen.value === null && !this.mayDelete;
    this.history.push({ what, path, back, ...(isFinal ? { refusal: t("outcome.needs_admin") } : {}), ...more });
  }

  /** Delete a resource that nobody could bring back, once the time to undo that is over. @param {string} what @param {string} path
   * @param {string} etag @param {string} note what is true until then */
  removeLater(what, path, etag, note) {
    const owner = {};
    let timer = 0;
    const send = async () => {
      clearTimeout(timer);
      this.history.forget(owner);
      try {
        await this.#swap(path, null, null, etag);
      } catch (error) {
        if (error instanceof UnreachableError) return void (timer = setTimeout(send, RETRY_MS));
        this.#tell("failed", error);
      }
      return void this.#leaving.delete(path);
    };
    const wait = () => {
      timer = setTimeout(send, UNDO_MS);
      this.#leaving.set(path, send);
      this.#tell("done", path);
      return stay;
    };
    const stay = () => {
      clearTimeout(timer);
      this.#leaving.delete(path);
      this.#tell("done", path);
      return wait;
    };
    this.history.push({ what, path, owner, note, back: wait() });
  }

  /** Return whether a resource is about to be deleted. @param {string} path */
  isLeaving(path) {
    return this.#leaving.has(path);
  }

  /** Return what takes the change back. @param {string} path @param {object | null} before @param {object | null} after
   * @param {string} etag of what there is before; empty: nothing @returns {Promise<import("./undo.js").Back>} */
  async #swap(path, before, after, etag) {
    /** @type {Record<string, string>} */
    const conditions = etag === "" ? { "if-none-match": "*" } : { "if-match": etag };
    const left = after === null
      ? await sendChange(api(deletedAt(path)), "DELETE", null, conditions)
      : await sendChange(api(path), "PUT", after, conditions);
    this.#tell("done", path);
    return () => this.#swap(path, after, before, left);
  }

  /** @param {string} what @param {() => Promise<unknown>} send @param {Omit<Conflict, "what">} [conflict] */
  async #attempt(what, send, conflict) {
    try {
      await send();
      return true;
    } catch (error) {
      if (error instanceof ChangedMeanwhileError && conflict) this.#tell("conflict", { what, ...conflict });
      else this.#tell("failed", error);
      return false;
    }
  }

  /** @param {string} name @param {any} detail */
  #tell(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}

/** A tag is deleted together with its settings. @param {string} path */
const deletedAt = (path) => path.replace(/^(tags\/[^/]+)\/settings$/, "$1");

/** Return the sentence of the service in the language of the page. @param {unknown} error */
export const sentence = (error) => refusal(error);
