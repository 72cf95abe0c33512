/** Draw a rectangle with the mouse and Shift, and give the tags inside it. */

const CLICK_PX = 6;

/** @typedef {{x: number, y: number}} Point pixels */

export class Rectangle {
  /** @type {{from: Point, to: Point} | null} */
  #drawn = null;

  /** @param {import("./map.js").LiveMap} map @param {(rows: number[]) => void} picked */
  constructor(map, picked) {
    this.map = map;
    this.picked = picked;
    const { canvas } = map;
    const capture = { capture: true };
    canvas.addEventListener("pointerdown", (event) => event.shiftKey && event.button === 0 && this.#begin(event), capture);
    canvas.addEventListener("pointermove", (event) => this.#drawn && this.#draw(event), capture);
    canvas.addEventListener("pointerup", (event) => this.#drawn && this.#end(event), capture);
    canvas.addEventListener("pointercancel", () => (this.#drawn = null), capture);
    map.overlays.push((scene) => this.#paint(scene));
  }

  /** @param {PointerEvent} event */
  #begin(event) {
    event.stopImmediatePropagation();
    this.map.canvas.setPointerCapture(event.pointerId);
    this.#drawn = { from: place(event), to: place(event) };
  }

  /** @param {PointerEvent} event */
  #draw(event) {
    event.stopImmediatePropagation();
    this.#drawn = { from: /** @type {{from: Point}} */ (this.#drawn).from, to: place(event) };
    this.map.redraw();
  }

  /** @param {PointerEvent} event */
  #end(event) {
    event.stopImmediatePropagation();
    const { from, to } = /** @type {{from: Point, to: Point}} */ (this.#drawn);
    this.#drawn = null;
    this.map.redraw();
    if (Math.hypot(to.x - from.x, to.y - from.y) >= CLICK_PX) return this.picked(this.map.tagsIn(boxOf(from, to)));
    const row = this.map.tagAt(to.x, to.y);
    return this.picked(row < 0 ? [] : [row]);
  }

  /** @param {import("./scene.js").Scene} scene */
  #paint({ ctx, palette }) {
    if (!this.#drawn) return;
    const { left, right, top, bottom } = boxOf(this.#drawn.from, this.#drawn.to);
    ctx.strokeStyle = ctx.fillStyle = palette.accent;
    ctx.lineWidth = 1.5;
    ctx.globalAlpha = 0.12;
    ctx.fillRect(left, top, right - left, bottom - top);
    ctx.globalAlpha = 1;
    ctx.strokeRect(left, top, right - left, bottom - top);
  }
}

/** @param {Point} a @param {Point} b @returns {import("./view.js").Bounds} pixels */
const boxOf = (a, b) => ({
  left: Math.min(a.x, b.x), right: Math.max(a.x, b.x), top: Math.min(a.y, b.y), bottom: Math.max(a.y, b.y),
});

/** @param {MouseEvent} event @returns {Point} */
const place = (event) => ({ x: event.offsetX, y: event.offsetY });
