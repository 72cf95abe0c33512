/** What is being saved now, so that nobody is asked about something that is not lost. */

export class Saving {
  /** Null: nothing is. @type {Promise<unknown> | null} */
  now = null;

  /** @template T @param {Promise<T>} saved */
  async until(saved) {
    this.now = saved;
    try {
      return await saved;
    } finally {
      if (this.now === saved) this.now = null;
    }
  }
}
