/** Many dots with their headings: painted once for each state and direction, then stamped. A path for each tag takes the browser several times as long. */

const DIRECTIONS = 48;
const SIZE_PX = 28;

/** @typedef {(ctx: CanvasRenderingContext2D, heading_rad: number, centre_px: number) => void} Paint */

export class Stamps {
  /** @type {Map<string, HTMLCanvasElement>} */
  #made = new Map();
  #look = "";

  /** Stamp dots that look alike. @param {import("./scene.js").Scene} scene @param {string} look what all but the heading depends on
   * @param {number[]} rows @param {Paint} paint one dot */
  draw({ ctx, view, fleet, palette }, look, rows, paint) {
    const ratio = ctx.getTransform().a;
    const all = `${palette.map} ${palette.state} ${ratio}`;
    if (all !== this.#look) [this.#look, this.#made] = [all, new Map()];
    ctx.save();
    ctx.setTransform(1, 0, 0, 1, 0, 0); // a stamp lies on whole pixels, so nothing has to be smoothed
    ctx.imageSmoothingEnabled = false;
    for (const row of rows) {
      const direction = Math.round((fleet.number.heading_rad[row] * DIRECTIONS) / (2 * Math.PI));
      const stamp = this.#stamp(`${look} ${(direction + DIRECTIONS) % DIRECTIONS}`, ratio, (direction * 2 * Math.PI) / DIRECTIONS, paint);
      const half = stamp.width / 2;
      ctx.drawImage(stamp, Math.round(view.screenX(fleet.drawnX[row]) * ratio - half), Math.round(view.screenY(fleet.drawnY[row]) * ratio - half));
    }
    ctx.restore();
  }

  /** @param {string} key @param {number} ratio @param {number} heading_rad NaN: unknown @param {Paint} paint */
  #stamp(key, ratio, heading_rad, paint) {
    let stamp = this.#made.get(key);
    if (!stamp) {
      const side = Math.ceil(SIZE_PX * ratio);
      this.#made.set(key, (stamp = Object.assign(document.createElement("canvas"), { width: side, height: side })));
      const ctx = /** @type {CanvasRenderingContext2D} */ (stamp.getContext("2d"));
      ctx.scale(ratio, ratio);
      paint(ctx, heading_rad, side / ratio / 2);
    }
    return stamp;
  }
}
