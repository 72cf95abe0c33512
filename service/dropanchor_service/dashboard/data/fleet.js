/** The latest pose of every tag in columns, with one row per tag in the order of their first appearance. */

import { OUT_OF_DATE, STATES, staleness, stateIn } from "./states.js";

/** Columns of numbers; unknown is NaN. Names as in the stream. */
const NUMBERS = /** @type {const} */ ([
  "x", "y", "z", "z_std_m", "floor_probability", "heading_rad", "speed_mps", "yaw_rate_radps", "sigma_pos_m", "sigma_obs_m", "p_mode", "range_m",
  "semi_major_m", "semi_minor_m", "angle_rad",
]);

/** A tag that is slower stands. */
const STANDS_MPS = 0.1;

/** Columns of values that are stored as received; unknown is null. */
const VALUES = /** @type {const} */ (["reason", "hint", "hint_phrase", "frame", "anchor", "hypotheses", "z_source", "floor"]);

/**
 * @typedef {object} Hypothesis
 * @property {number} weight
 * @property {number} x
 * @property {number} y
 * @property {number} heading_rad
 * @property {number} speed_mps
 * @property {{semi_major_m: number, semi_minor_m: number, angle_rad: number} | null} [ellipse_95]
 */

/** @typedef {{name?: string, group?: string, colour?: string | null}} Given by an operator to a tag */

/** @typedef {{settings: Given, lag_s?: number}} Described */

/**
 * A frame of the stream: `tags` and columns beside it. Values of a missing column stay unchanged.
 * @typedef {{t_ns: number, tags: string[]} & Record<string, any>} Frame
 */

export class Fleet {
  size = 0;
  /** False from the loss of the connection until the service has sent all poses again. */
  current = true;
  /** True while the poses are those of a time in the past. */
  past = false;
  /** Grows whenever tags come or go. */
  membership = 0;
  /** @type {string[]} */
  names = [];
  /** What people call the tag: its display name, or its id. @type {string[]} */
  labels = [];
  /** Empty: none. @type {string[]} */
  groups = [];
  /** Empty: none. @type {string[]} */
  colours = [];
  /** Seconds by which the poses come late, because the tag sends its motion in batches. @type {number[]} */
  lags = [];
  /** @type {ReadonlyMap<string, Described>} */
  #described = new Map();
  /** @type {Map<string, number>} */
  #rows = new Map();
  state = new Uint8Array(0);
  online = new Uint8Array(0);
  /** Time at which the pose was valid, in ms on the clock of the caller; NaN before the first pose. */
  poseTime = new Float64Array(0);
  /** Since when the tag has stood, on the clock of the caller; NaN: it does not. */
  #stoppedAt = new Float64Array(0);
  /** Whether it has been seen in motion. */
  #hasMoved = new Uint8Array(0);
  /** Where the dot is drawn: follows x, y smoothly (see motion.js). */
  drawnX = new Float32Array(0);
  drawnY = new Float32Array(0);
  /** Place in a frame of the tag's own, where it is drawn while its place on the map is not known; NaN: none. */
  ownX = new Float32Array(0);
  ownY = new Float32Array(0);
  /** @type {Record<typeof NUMBERS[number], Float32Array>} */
  number = /** @type {any} */ (Object.fromEntries(NUMBERS.map((name) => [name, new Float32Array(0)])));
  /** @type {{reason: (string|null)[], hint: (string|null)[], hint_phrase: (import("../i18n/said.js").Phrase|null)[], frame: (string|null)[], anchor: (string|null)[], z_source: (string|null)[], floor: (string|null)[], hypotheses: (Hypothesis[]|null)[]}} */
  value = { reason: [], hint: [], hint_phrase: [], frame: [], anchor: [], z_source: [], floor: [], hypotheses: [] };

  /** @param {string | null} name @returns {number} −1: no such tag */
  row(name) {
    return name === null ? -1 : (this.#rows.get(name) ?? -1);
  }

  /** Seconds since the pose was valid; NaN before the first pose. @param {number} row @param {number} now_ms */
  age(row, now_ms) {
    return (now_ms - this.poseTime[row]) / 1000;
  }

  /** Seconds since when the tag has stood; NaN: it moves, or nobody knows. @param {number} row @param {number} now_ms */
  stoppedFor(row, now_ms) {
    return this.current && !this.past ? (now_ms - this.#stoppedAt[row]) / 1000 : NaN;
  }

  /** Whether the tag was seen in motion before it stopped. @param {number} row */
  sawStop(row) {
    return this.#hasMoved[row] === 1;
  }

  /** Return the label, meaning and shape of a tag's state. @param {number} row @returns {import("./states.js").StateStyle} */
  style(row) {
    return this.current ? STATES[this.state[row]] : OUT_OF_DATE;
  }

  /** 0 fresh, 1 stale, 2 old. @param {number} row @param {number} now_ms @returns {0 | 1 | 2} */
  staleness(row, now_ms) {
    return this.current ? staleness(this.age(row, now_ms) - this.lags[row]) : 2;
  }

  /** Return whether a pose is turned about the anchor by an unknown angle, so that it is no place of the map. @param {number} row */
  isTurned(row) {
    return this.value.frame[row] === "relative";
  }

  /** Return where the dot of a tag belongs: its place on the map, or the one in its own frame. A lost tag has only the first:
   * its cross says where it was. @param {number} row @returns {[number, number]} */
  spot(row) {
    const { x, y } = this.number;
    if (!Number.isNaN(x[row])) return [x[row], y[row]];
    return STATES[this.state[row]]?.name === "lost" ? [NaN, NaN] : [this.ownX[row], this.ownY[row]];
  }

  /** @param {number} row */
  hasPose(row) {
    return row >= 0 && !Number.isNaN(this.poseTime[row]);
  }

  /** Set what an operator has given to the tags, and how late they are, by name. @param {ReadonlyMap<string, Described>} statuses */
  describe(statuses) {
    this.#described = statuses;
    for (let row = 0; row < this.size; row++) this.#describeRow(row);
  }

  /** @param {number} row */
  #describeRow(row) {
    const { settings, lag_s = 0 } = this.#described.get(this.names[row]) ?? {};
    const { name = "", group = "", colour = null } = settings ?? {};
    const label = name || this.names[row];
    if (label !== this.labels[row] || group !== this.groups[row]) this.membership++;
    this.labels[row] = label;
    this.groups[row] = group;
    this.colours[row] = colour ?? "";
    this.lags[row] = lag_s;
  }

  /** Apply a frame that changes some tags. @param {Frame} frame @param {number} now_ms */
  apply(frame, now_ms) {
    const rows = this.#rowsOf(frame.tags);
    for (const name of NUMBERS) if (frame[name]) writeNumbers(this.number[name], rows, frame[name]);
    for (const name of VALUES) if (frame[name]) writeValues(this.value[name], rows, frame[name]);
    if (frame.state) rows.forEach((row, i) => (this.state[row] = stateIn(frame.state[i], frame.frame?.[i])));
    if (frame.relative_pose) writeNumbers(this.ownX, rows, frame.relative_pose.map((/** @type {any} */ own) => own?.x));
    if (frame.relative_pose) writeNumbers(this.ownY, rows, frame.relative_pose.map((/** @type {any} */ own) => own?.y));
    if (frame.online) rows.forEach((row, i) => (this.online[row] = frame.online[i] ? 1 : 0));
    if (frame.speed_mps) for (const row of rows) this.#noteMotion(row, now_ms);
    if (frame.age_s) rows.forEach((row, i) => (this.poseTime[row] = now_ms - (frame.age_s[i] ?? NaN) * 1000));
  }

  /** @param {number} row @param {number} now_ms */
  #noteMotion(row, now_ms) {
    const stands = this.number.speed_mps[row] < STANDS_MPS;
    if (!stands) this.#stoppedAt[row] = NaN;
    else if (Number.isNaN(this.#stoppedAt[row])) this.#stoppedAt[row] = now_ms;
    if (this.number.speed_mps[row] >= STANDS_MPS) this.#hasMoved[row] = 1;
  }

  /** Apply a frame that names every tag. Remove all other tags. @param {Frame} frame @param {number} now_ms */
  replace(frame, now_ms) {
    const named = new Set(frame.tags);
    if (this.names.some((name) => !named.has(name))) this.#clear();
    this.apply(frame, now_ms);
    this.current = true;
  }

  #clear() {
    this.size = 0;
    this.names = [];
    this.labels = [];
    this.groups = [];
    this.colours = [];
    this.lags = [];
    this.#rows.clear();
    this.membership++;
  }

  /** @param {string[]} tags */
  #rowsOf(tags) {
    const rows = new Int32Array(tags.length);
    for (let i = 0; i < tags.length; i++) rows[i] = this.#rows.get(tags[i]) ?? this.#register(tags[i]);
    return rows;
  }

  /** @param {string} name */
  #register(name) {
    const row = this.size++;
    if (row >= this.state.length) this.#grow();
    this.names.push(name);
    this.#describeRow(row);
    this.#rows.set(name, row);
    this.membership++;
    for (const column of Object.values(this.number)) column[row] = NaN;
    for (const column of Object.values(this.value)) column[row] = null;
    this.state[row] = this.online[row] = this.#hasMoved[row] = 0;
    this.poseTime[row] = this.#stoppedAt[row] = this.drawnX[row] = this.drawnY[row] = this.ownX[row] = this.ownY[row] = NaN;
    return row;
  }

  #grow() {
    const capacity = Math.max(64, 2 * this.state.length);
    this.state = grown(this.state, new Uint8Array(capacity));
    this.online = grown(this.online, new Uint8Array(capacity));
    this.#stoppedAt = grown(this.#stoppedAt, new Float64Array(capacity));
    this.#hasMoved = grown(this.#hasMoved, new Uint8Array(capacity));
    this.poseTime = grown(this.poseTime, new Float64Array(capacity));
    this.drawnX = grown(this.drawnX, new Float32Array(capacity));
    this.drawnY = grown(this.drawnY, new Float32Array(capacity));
    this.ownX = grown(this.ownX, new Float32Array(capacity));
    this.ownY = grown(this.ownY, new Float32Array(capacity));
    for (const name of NUMBERS) this.number[name] = grown(this.number[name], new Float32Array(capacity));
  }
}

/** @template {Uint8Array | Float32Array | Float64Array} T @param {T} from @param {T} to @returns {T} */
function grown(from, to) {
  to.set(from);
  return to;
}

/** @param {Float32Array} column @param {Int32Array} rows @param {(number | null | undefined)[]} values */
function writeNumbers(column, rows, values) {
  for (let i = 0; i < rows.length; i++) column[rows[i]] = values[i] ?? NaN;
}

/** @param {any[]} column @param {Int32Array} rows @param {any[]} values */
function writeValues(column, rows, values) {
  for (let i = 0; i < rows.length; i++) column[rows[i]] = values[i] ?? null;
}
