/** Decode and draw an image within a time: a drawing that takes longer must not stop the page. */

export const PATIENCE_MS = 2000;
const SMALLEST_PX = 16;
const GROWTH = 4; // of the sides from one attempt to the next

/** The image takes too long to be shown. */
export class TooSlowError extends Error {}

/** Return what comes within the time. Rejects with TooSlowError. @template T @param {Promise<T>} promise @returns {Promise<T>} */
export function inTime(promise) {
  return Promise.race([promise, new Promise((_, reject) => setTimeout(() => reject(new TooSlowError()), PATIENCE_MS))]);
}

/** Return the largest drawing with at most this many pixels along its longer side that is drawn in time, or null.
 *
 * It is drawn in growing sizes. How much longer one took than the one before tells how long the next will take; what seems
 * slow is measured twice, since the machine may have been busy with something else.
 * @template T @param {number} side_px @param {(side_px: number) => T} draw @param {() => number} [now_ms]
 * @returns {Promise<{drawing: T, isWhole: boolean} | null>} */
export async function drawnInTime(side_px, draw, now_ms = () => performance.now()) {
  let [found, last_ms] = [/** @type {{drawing: T, isWhole: boolean} | null} */ (null), PATIENCE_MS];
  for (let side = Math.min(SMALLEST_PX, side_px); ; side = Math.min(side * GROWTH, side_px)) {
    let { drawing, took_ms } = timed(() => draw(side), now_ms);
    if (took_ms > PATIENCE_MS) return found;
    found = { drawing, isWhole: side >= side_px };
    if (found.isWhole) return found;
    if (nextTime(took_ms, last_ms) > PATIENCE_MS) took_ms = Math.min(took_ms, timed(() => draw(side), now_ms).took_ms);
    if (nextTime(took_ms, last_ms) > PATIENCE_MS) return found;
    last_ms = took_ms;
    await new Promise((resolve) => setTimeout(resolve)); // the page lives on meanwhile
  }
}

/** @param {number} took_ms @param {number} last_ms */
const nextTime = (took_ms, last_ms) => took_ms + GROWTH ** 2 * Math.max(0, took_ms - last_ms);

/** @template T @param {() => T} draw @param {() => number} now_ms */
function timed(draw, now_ms) {
  const begin_ms = now_ms();
  return { drawing: draw(), took_ms: now_ms() - begin_ms };
}
