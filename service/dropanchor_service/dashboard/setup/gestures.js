/** Give presses and keys on the map to the tool that is in use, before the map pans or selects. */

/**
 * @typedef {object} Tool
 * @property {(at: Spot) => boolean} press returns whether the tool takes this press
 * @property {(at: Spot) => void} drag
 * @property {() => void} drop
 * @property {(event: KeyboardEvent) => boolean} key returns whether the tool takes this key
 * @property {() => boolean} cancel returns whether there was anything to cancel
 */
/** @typedef {{x: number, y: number, px: number, py: number}} Spot metres and pixels */

/** @param {import("../map/map.js").LiveMap} map @param {Tool[]} tools */
export function giveTo(map, tools) {
  const { canvas, view } = map;
  /** @type {Tool | null} */
  let active = null;
  const spot = (/** @type {PointerEvent} */ { offsetX, offsetY }) =>
    ({ x: view.worldX(offsetX), y: view.worldY(offsetY), px: offsetX, py: offsetY });
  const capture = { capture: true };
  canvas.addEventListener("pointerdown", (event) => {
    if (!event.isPrimary || event.button !== 0) return;
    active = tools.find((tool) => tool.press(spot(event))) ?? null;
    if (!active) return;
    event.stopImmediatePropagation();
    canvas.setPointerCapture(event.pointerId);
    map.takeOver();
  }, capture);
  canvas.addEventListener("pointermove", (event) => {
    if (!active) return;
    event.stopImmediatePropagation();
    active.drag(spot(event));
  }, capture);
  for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) {
    canvas.addEventListener(name, (event) => {
      if (!active) return;
      event.stopImmediatePropagation();
      if (name === "pointerup") active.drop();
      else active.cancel();
      active = null;
    }, capture);
  }
  canvas.addEventListener("keydown", (event) => {
    if (!tools.some((tool) => tool.key(event))) return;
    event.stopImmediatePropagation();
    event.preventDefault();
  }, capture);
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && tools.some((tool) => tool.cancel())) event.stopImmediatePropagation();
  }, capture);
}

const STEP_M = 0.1;
const LARGE_STEP_M = 1;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/** Return by how much an arrow key moves what is edited, m; undefined for another key. @param {KeyboardEvent} event */
export const stepOf = ({ key, shiftKey }) => ARROWS[/** @type {keyof typeof ARROWS} */ (key)]?.map((way) => way * (shiftKey ? LARGE_STEP_M : STEP_M));

/** @param {number} metres */
export const toCentimetre = (metres) => Math.round(metres * 100) / 100;
