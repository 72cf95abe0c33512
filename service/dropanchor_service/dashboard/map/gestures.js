/** Pan and zoom with mouse, touch and keyboard, and select with a click or a tap. */

const CLICK_PX = 6;
const PAN_KEY_PX = 60;
const ZOOM_KEY = 1.4;
const DOUBLE_TAP_MS = 300;
const DOUBLE_TAP_PX = 24;

/** @typedef {import("./map.js").LiveMap} LiveMap */
/** @typedef {{x: number, y: number}} Point */

/** @param {LiveMap} map @param {(row: number, isAlso: boolean) => void} pick −1: no tag. isAlso: beside those that are selected */
export function listen(map, pick) {
  const { canvas } = map;
  const pointers = new Pointers(map, pick);
  canvas.addEventListener("pointerdown", (event) => pointers.down(event));
  canvas.addEventListener("pointermove", (event) => pointers.move(event));
  canvas.addEventListener("pointerup", (event) => pointers.up(event));
  canvas.addEventListener("pointercancel", (event) => pointers.remove(event));
  canvas.addEventListener("pointerleave", () => hover(map, -1));
  canvas.addEventListener("wheel", (event) => onWheel(map, event), { passive: false });
  canvas.addEventListener("keydown", (event) => onKey(map, event));
}

class Pointers {
  /** @type {Map<number, Point>} */
  #at = new Map();
  /** Start of a press that may still become a click. @type {Point | null} */
  #pressed = null;
  #lastTap = { x: NaN, y: NaN, time_ms: -Infinity };

  /** @param {LiveMap} map @param {(row: number, isAlso: boolean) => void} pick */
  constructor(map, pick) {
    this.map = map;
    this.pick = pick;
  }

  /** @param {PointerEvent} event */
  down(event) {
    if (event.button !== 0) return;
    this.map.canvas.setPointerCapture(event.pointerId);
    this.#pressed = this.#at.size === 0 ? place(event) : null;
    this.#at.set(event.pointerId, place(event));
  }

  /** @param {PointerEvent} event */
  move(event) {
    const before = this.#at.get(event.pointerId);
    const now = place(event);
    if (!before) return hover(this.map, event.pointerType === "mouse" ? this.map.tagAt(now.x, now.y) : -1);
    if (this.#pressed && apart(this.#pressed, now) < CLICK_PX) return undefined;
    this.#pressed = null;
    const other = [...this.#at].find(([id]) => id !== event.pointerId)?.[1];
    if (other) this.#pinch(before, now, other);
    else this.#drag(before, now);
    this.#at.set(event.pointerId, now);
    return undefined;
  }

  /** @param {PointerEvent} event */
  up(event) {
    if (this.#pressed) this.#click(event, this.#pressed);
    this.remove(event);
  }

  /** @param {PointerEvent} event */
  remove(event) {
    this.#at.delete(event.pointerId);
    this.#pressed = null;
  }

  /** @param {Point} before @param {Point} now */
  #drag(before, now) {
    this.map.takeOver();
    this.map.view.pan(now.x - before.x, now.y - before.y);
  }

  /** @param {Point} before @param {Point} now @param {Point} other the finger that does not move */
  #pinch(before, now, other) {
    this.map.zoom(apart(now, other) / Math.max(1, apart(before, other)), (now.x + other.x) / 2, (now.y + other.y) / 2);
    this.map.view.pan((now.x - before.x) / 2, (now.y - before.y) / 2);
  }

  /** @param {PointerEvent} event @param {Point} at */
  #click(event, at) {
    if (this.map.pressed(at.x, at.y)) return;
    const row = this.map.tagAt(at.x, at.y);
    const double = event.timeStamp - this.#lastTap.time_ms < DOUBLE_TAP_MS && apart(at, this.#lastTap) < DOUBLE_TAP_PX;
    this.#lastTap = { ...at, time_ms: event.timeStamp };
    if (double && row < 0) this.map.zoom(2, at.x, at.y);
    else this.pick(row, event.ctrlKey || event.metaKey);
  }
}

/** @param {LiveMap} map @param {number} row */
function hover(map, row) {
  if (row === map.hovered) return;
  map.hovered = row;
  map.canvas.style.cursor = row >= 0 ? "pointer" : "";
  map.redraw();
}

/** @param {LiveMap} map @param {WheelEvent} event */
function onWheel(map, event) {
  event.preventDefault();
  const pixels = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? event.deltaY * 16 : event.deltaY;
  const factor = Math.exp(-Math.max(-240, Math.min(240, pixels)) * (event.ctrlKey ? 0.01 : 0.0022));
  const { x, y } = place(event);
  if (map.choice.follow) map.zoom(factor);
  else map.zoom(factor, x, y);
}

/** @param {LiveMap} map @param {KeyboardEvent} event */
function onKey(map, event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const pans = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  const pan = pans[/** @type {keyof typeof pans} */ (event.key)];
  if (pan) {
    map.takeOver();
    map.view.pan(pan[0] * PAN_KEY_PX, pan[1] * PAN_KEY_PX);
  } else if (event.key === "+" || event.key === "=") map.zoom(ZOOM_KEY);
  else if (event.key === "-" || event.key === "_") map.zoom(1 / ZOOM_KEY);
  else if (event.key === "0" || event.key === "f") map.fitAll();
  else return;
  event.preventDefault();
}

/** @param {MouseEvent} event @returns {Point} */
const place = (event) => ({ x: event.offsetX, y: event.offsetY });

/** @param {Point} a @param {Point} b */
const apart = (a, b) => Math.hypot(a.x - b.x, a.y - b.y);
