/** Drop frames of a process that no longer serves the site. */

/** The frame is of a former owner of the site. */
export class FormerOwnerError extends Error {}

export class EpochFence {
  #highest = 0;

  /** Throw FormerOwnerError if a frame has a lower epoch than one before. @param {{epoch?: number}} frame */
  check(frame) {
    const epoch = frame.epoch ?? 0;
    if (epoch < this.#highest) throw new FormerOwnerError(`the frame has epoch ${epoch}, after one of ${this.#highest}`);
    this.#highest = epoch;
  }
}
