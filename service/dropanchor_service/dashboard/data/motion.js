/** Move the drawn positions smoothly, so that 10 poses per second look like continuous motion. */

const TIME_CONSTANT_MS = 70;
const SETTLED_M = 0.002;
/** A larger step is a jump to another hypothesis and no motion. It is drawn as a jump. */
const JUMP_M = 1.5;

/**
 * Move the drawn positions towards the poses. Return whether any of them is still moving.
 * @param {import("./fleet.js").Fleet} fleet
 * @param {number} elapsed_ms since the last call
 * @param {boolean} smooth false: jump to the poses
 */
export function follow(fleet, elapsed_ms, smooth) {
  const share = smooth ? 1 - Math.exp(-elapsed_ms / TIME_CONSTANT_MS) : 1;
  let moving = false;
  for (let row = 0; row < fleet.size; row++) {
    const [x, y] = fleet.spot(row);
    const dx = x - fleet.drawnX[row];
    const dy = y - fleet.drawnY[row];
    const left = Math.abs(dx) + Math.abs(dy);
    if (share < 1 && left > SETTLED_M && left < JUMP_M) {
      fleet.drawnX[row] += share * dx;
      fleet.drawnY[row] += share * dy;
      moving = true;
    } else {
      fleet.drawnX[row] = x;
      fleet.drawnY[row] = y;
    }
  }
  return moving;
}
