/** The visible part of the plane. World: metres, x east, y north. Screen: CSS pixels, y down. */

import { units } from "../data/units.js";

/** @typedef {{left: number, bottom: number, right: number, top: number}} Bounds metres */

export const MIN_SCALE = 0.005;
export const MAX_SCALE = 4000;

/** @param {number} scale */
export const limited = (scale) => Math.min(MAX_SCALE, Math.max(MIN_SCALE, scale));

export class View {
  x = 0;
  y = 0;
  /** pixels per metre */
  scale = 40;
  width = 1;
  height = 1;
  /** pixels on the right that buttons cover */
  covered = 0;

  /** @param {number} x */
  screenX(x) {
    return this.width / 2 + (x - this.x) * this.scale;
  }

  /** @param {number} y */
  screenY(y) {
    return this.height / 2 - (y - this.y) * this.scale;
  }

  /** @param {number} px */
  worldX(px) {
    return this.x + (px - this.width / 2) / this.scale;
  }

  /** @param {number} py */
  worldY(py) {
    return this.y - (py - this.height / 2) / this.scale;
  }

  /** @param {number} dx pixels @param {number} dy pixels */
  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
  }

  /** Zoom so that the point under (px, py) stays there. @param {number} factor @param {number} px @param {number} py */
  zoomAt(factor, px, py) {
    const x = this.worldX(px);
    const y = this.worldY(py);
    this.scale = limited(this.scale * factor);
    this.x = x - (px - this.width / 2) / this.scale;
    this.y = y + (py - this.height / 2) / this.scale;
  }

  /**
   * Return the view that shows all of `bounds` beside the buttons.
   * @param {Bounds} bounds
   * @param {number} padding pixels on every side
   * @returns {{x: number, y: number, scale: number}}
   */
  fitted(bounds, padding) {
    const width = Math.max(1, this.width - this.covered - 2 * padding);
    const height = Math.max(1, this.height - 2 * padding);
    const scale = limited(Math.min(width / (bounds.right - bounds.left), height / (bounds.top - bounds.bottom)));
    const x = (bounds.left + bounds.right + this.covered / scale) / 2;
    return { x, y: (bounds.bottom + bounds.top) / 2, scale };
  }

  /** Return the part that no button covers, at least `margin` pixels from the edge. @param {number} margin @returns {Bounds} */
  free(margin) {
    return { ...this.bounds(-margin), right: this.worldX(this.width - this.covered - margin) };
  }

  /** Return the visible part, extended by `margin` pixels. @param {number} margin @returns {Bounds} */
  bounds(margin = 0) {
    return {
      left: this.worldX(-margin),
      right: this.worldX(this.width + margin),
      top: this.worldY(-margin),
      bottom: this.worldY(this.height + margin),
    };
  }
}

/**
 * Return the bounds around points, at least `smallest` metres wide and high; null without points.
 * @param {Iterable<readonly [number, number]>} points with an unknown coordinate are ignored
 * @param {number} smallest
 * @returns {Bounds | null}
 */
export function boundsAround(points, smallest) {
  let [left, right, bottom, top] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const [x, y] of points) {
    if (!Number.isFinite(x) || !Number.isFinite(y)) continue;
    left = Math.min(left, x);
    right = Math.max(right, x);
    bottom = Math.min(bottom, y);
    top = Math.max(top, y);
  }
  if (left > right) return null;
  const growX = Math.max(0, smallest - (right - left)) / 2;
  const growY = Math.max(0, smallest - (top - bottom)) / 2;
  return { left: left - growX, right: right + growX, bottom: bottom - growY, top: top + growY };
}

/** Return the smallest of 1, 2, 5 × 10ⁿ that is at least `min`. @param {number} min */
export function roundStep(min) {
  const power = 10 ** Math.floor(Math.log10(min));
  for (const factor of [1, 2, 5]) {
    if (factor * power >= min * (1 - 1e-9)) return factor * power;
  }
  return 10 * power;
}

/** Return the smallest length of 1, 2, 5 × 10ⁿ units of the page that is at least `min`. @param {number} min m */
export const roundLength = (min) => roundStep(min * units.length.factor) / units.length.factor;

/** Return the multiples of `step` within [low, high]. @param {number} low @param {number} high @param {number} step */
export function multiples(low, high, step) {
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, i) => (first + i) * step);
}
