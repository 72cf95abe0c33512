/** Messages that wait for their answer. They stay in order, and survive a reload of the page in IndexedDB. */

/**
 * @typedef {object} Message
 * @property {number} id ascending
 * @property {number} samples
 * @property {number} t0_us UTC of the device at the first sample
 * @property {Uint8Array} bytes
 */

export const MAX_MESSAGES = 36_000;
/** How long a message is kept after its answer: a killed service may have to be sent it again. */
const KEPT_MS = 5000;

export class Queue {
  /** Samples that were dropped because the queue was full. */
  lost = 0;
  /** Samples that wait. */
  samples = 0;
  #waiting = /** @type {Message[]} */ ([]);
  #answered = /** @type {{ message: Message, at_ms: number }[]} */ ([]);
  #inFlight = 0;
  #stored = /** @type {Set<number>} */ (new Set());
  #next = 0;

  /** @param {Store} store @param {number} max */
  constructor(store, max = MAX_MESSAGES) {
    this.store = store;
    this.max = max;
  }

  /** Take over what an earlier page left. */
  async load() {
    for (const message of await this.store.all()) {
      this.#stored.add(message.id);
      this.#next = message.id + 1;
      this.#append(message);
    }
  }

  /** @param {Omit<Message, "id">} message */
  add(message) {
    this.#append({ ...message, id: this.#next++ });
    if (this.#waiting.length <= this.max) return;
    const [dropped] = this.#waiting.splice(this.#inFlight, 1);
    this.samples -= dropped.samples;
    this.lost += dropped.samples;
  }

  get length() {
    return this.#waiting.length;
  }

  get inFlight() {
    return this.#inFlight;
  }

  /** Return the next message to send; undefined when all are sent. */
  next() {
    const message = this.#waiting[this.#inFlight];
    if (message !== undefined) this.#inFlight++;
    return message;
  }

  /** Remove the oldest message that was sent: it is answered. Return it. */
  answered() {
    const message = this.#waiting.shift();
    if (message === undefined || this.#inFlight === 0) throw new Error("an answer without a message");
    this.#inFlight--;
    this.samples -= message.samples;
    const at_ms = performance.now();
    this.#answered.push({ message, at_ms });
    while (this.#answered[0].at_ms < at_ms - KEPT_MS) this.#answered.shift();
    return message;
  }

  /** The connection broke: everything without an answer is to be sent again. */
  again() {
    this.#inFlight = 0;
  }

  /** The service was started anew: send again what was answered just before. Nothing may be in flight. Return how many
   * samples that is. */
  restore() {
    const messages = this.#answered.splice(0).map(({ message }) => message);
    const samples = messages.reduce((sum, message) => sum + message.samples, 0);
    this.#waiting.unshift(...messages);
    this.samples += samples;
    return samples;
  }

  /** Store what waits, and remove from the store what does not wait any more. */
  async save() {
    const waiting = new Set(this.#waiting.map(({ id }) => id));
    const added = this.#waiting.filter(({ id }) => !this.#stored.has(id));
    const removed = [...this.#stored].filter((id) => !waiting.has(id));
    if (!added.length && !removed.length) return;
    await this.store.change(added, removed);
    for (const { id } of added) this.#stored.add(id);
    for (const id of removed) this.#stored.delete(id);
  }

  /** @param {Message} message */
  #append(message) {
    this.#waiting.push(message);
    this.samples += message.samples;
  }
}

/** The messages of one tag in IndexedDB. Without IndexedDB, as in some private windows, it stores nothing. */
export class Store {
  /** @param {IDBDatabase | null} database */
  constructor(database) {
    this.database = database;
  }

  /** @param {string} tag */
  static async open(tag) {
    try {
      const request = indexedDB.open(`dropanchor-tag-${tag}`, 1);
      request.onupgradeneeded = () => request.result.createObjectStore("messages", { keyPath: "id" });
      return new Store(await done(request));
    } catch {
      return new Store(null);
    }
  }

  /** @returns {Promise<Message[]>} in their order */
  async all() {
    if (this.database === null) return [];
    return done(this.database.transaction("messages").objectStore("messages").getAll());
  }

  /** @param {Message[]} added @param {number[]} removed */
  async change(added, removed) {
    if (this.database === null) return;
    const transaction = this.database.transaction("messages", "readwrite");
    const messages = transaction.objectStore("messages");
    for (const message of added) messages.put(message);
    for (const id of removed) messages.delete(id);
    await new Promise((resolve, reject) => {
      transaction.oncomplete = resolve;
      transaction.onabort = () => reject(transaction.error);
    });
  }
}

/** @template T @param {IDBRequest<T>} request @returns {Promise<T>} */
const done = (request) =>
  new Promise((resolve, reject) => {
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
