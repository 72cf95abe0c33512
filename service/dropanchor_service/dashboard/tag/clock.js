/** The clock of this device, and how far it is from that of the service. Times are UTC in µs. */

const KEPT = 20;
/** A smaller error is not corrected: devices that set their clocks from the network are as exact as that. */
const TOLERATED_US = 50_000;

export class Clock {
  #origin_ms = 0;
  #exchanges = /** @type {{ offset_us: number, half_us: number }[]} */ ([]);
  #correction_us = 0;

  constructor() {
    this.set();
  }

  /** Read the device's UTC again: the time of the page stands still while some devices sleep. */
  set() {
    this.#origin_ms = Date.now() - performance.now();
  }

  /** Return the device's UTC of a time of the page. @param {number} [time_ms] as `performance.now()` */
  local_us(time_ms = performance.now()) {
    return Math.round((this.#origin_ms + time_ms) * 1000);
  }

  /** Note when a message was sent and its answer came, and the service's time in between. @param {number} sent_us
   * @param {number} service_us @param {number} [answered_us] */
  note(sent_us, service_us, answered_us = this.local_us()) {
    const half_us = (answered_us - sent_us) / 2;
    this.#exchanges = [...this.#exchanges.slice(1 - KEPT), { offset_us: service_us - sent_us - half_us, half_us }];
    const best = this.best;
    const wanted_us = best !== null && Math.abs(best.offset_us) > best.half_us + TOLERATED_US ? best.offset_us : 0;
    if (Math.abs(wanted_us - this.#correction_us) > TOLERATED_US) this.#correction_us = wanted_us;
  }

  /** The service's time minus ours by the fastest of the last exchanges, and how wrong that may be; null before one. */
  get best() {
    return this.#exchanges.reduce(
      (best, next) => (best === null || next.half_us < best.half_us ? next : best),
      /** @type {{ offset_us: number, half_us: number } | null} */ (null),
    );
  }

  /** What is added to the times of samples when they are sent: the offset, where it is certain and large. */
  get correction_us() {
    return Math.round(this.#correction_us);
  }
}
