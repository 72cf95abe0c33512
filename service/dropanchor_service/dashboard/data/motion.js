/** Drawn positions follow the poses smoothly, so that 10 poses a second look like motion. */

const TIME_CONSTANT_MS = 70;
const SETTLED_M = 0.002;
/** A move this large is a new place (another mode was chosen), not a motion: it is shown as the jump that it is. */
const JUMP_M = 1.5;

/**
 * Move the drawn positions towards the poses. Returns whether any is still on its way.
 * @param {import("./fleet.js").Fleet} fleet
 * @param {number} elapsed_ms since the last call
 * @param {boolean} smooth false: be there at once
 */
export function follow(fleet, elapsed_ms, smooth) {
  const { x, y } = fleet.number;
  const share = smooth ? 1 - Math.exp(-elapsed_ms / TIME_CONSTANT_MS) : 1;
  let moving = false;
  for (let row = 0; row < fleet.size; row++) {
    const dx = x[row] - fleet.drawnX[row];
    const dy = y[row] - fleet.drawnY[row];
    const left = Math.abs(dx) + Math.abs(dy);
    if (share < 1 && left > SETTLED_M && left < JUMP_M) {
      fleet.drawnX[row] += share * dx;
      fleet.drawnY[row] += share * dy;
      moving = true;
    } else {
      fleet.drawnX[row] = x[row];
      fleet.drawnY[row] = y[row];
    }
  }
  return moving;
}
