/** A small plot over time as SVG. Its colours come from the style sheet. */

import { fixed } from "../data/format.js";
import { multiples, roundStep } from "../map/view.js";

const SVG = "http://www.w3.org/2000/svg";
const [LEFT, RIGHT, TOP, BOTTOM] = [34, 8, 6, 5];
const HEIGHT = 74;
const STRIP = 4;
const LINES_PX = 24;
const SECONDS_PX = 70;

/** @typedef {{t: number, value: number}} Point t: s, at most 0 */

export class Plot {
  #svg = /** @type {SVGSVGElement} */ (document.createElementNS(SVG, "svg"));
  #width = 0;
  #span = 1;
  #low = 0;
  #high = 1;

  /** @param {HTMLElement} figure */
  constructor(figure) {
    this.#svg.setAttribute("role", "img");
    this.#svg.setAttribute("height", String(HEIGHT));
    figure.append(this.#svg);
  }

  /** Draw the empty plot of the last `span` seconds with a scale that contains these values.
   * @param {number} span @param {number[]} values @param {number} minRange smallest range of the scale */
  begin(span, values, minRange) {
    this.#width = this.#svg.clientWidth || 500;
    this.#span = span;
    const [low, high] = [Math.min(...values), Math.max(...values)];
    const margin = Math.max(0.06 * (high - low), (minRange - (high - low)) / 2, 0);
    [this.#low, this.#high] = values.length ? [low - margin, high + margin] : [0, minRange];
    this.#svg.setAttribute("viewBox", `0 0 ${this.#width} ${HEIGHT}`);
    this.#svg.replaceChildren();
    this.#grid();
  }

  /** @param {string} text */
  set label(text) {
    this.#svg.setAttribute("aria-label", text);
  }

  /** @param {number} t */
  x(t) {
    return this.#width - RIGHT + (t / this.#span) * (this.#width - LEFT - RIGHT);
  }

  /** @param {number} value */
  y(value) {
    return HEIGHT - BOTTOM - ((value - this.#low) / (this.#high - this.#low)) * (HEIGHT - TOP - BOTTOM);
  }

  /** Return whether the scale contains a value. @param {number} value */
  shows(value) {
    return value >= this.#low && value <= this.#high;
  }

  /** Draw a line from the bottom to the top. @param {string} name @param {number} t */
  upright(name, t) {
    this.line(name, [{ t, value: this.#low }, { t, value: this.#high }]);
  }

  /** @param {string} name class of the path @param {readonly Point[]} points */
  line(name, points) {
    this.#path(name, points.map(({ t, value }, i) => `${i ? "L" : "M"}${this.#at(t, value)}`).join(""));
  }

  /** Fill the area between two lines. @param {string} name @param {readonly Point[]} upper @param {readonly Point[]} lower */
  band(name, upper, lower) {
    const around = [...upper, ...[...lower].reverse()];
    if (around.length) this.#path(name, `M${around.map(({ t, value }) => this.#at(t, value)).join("L")}Z`);
  }

  /** Draw a stretch of a strip along the bottom, in the colour of a state. @param {string} state @param {number} from @param {number} to s, at most 0 */
  strip(state, from, to) {
    const [left, right] = [this.x(from), Math.max(this.x(to), this.x(from) + 1)];
    this.#path("strip", `M${left.toFixed(1)} ${HEIGHT - STRIP}H${right.toFixed(1)}V${HEIGHT}H${left.toFixed(1)}Z`).dataset.state = state;
  }

  /** @param {string} name @param {readonly Point[]} points */
  dots(name, points) {
    this.#path(name, points.map(({ t, value }) => `M${this.#at(t, value)}h0`).join(""));
  }

  /** @param {string} name @param {readonly Point[]} points */
  crosses(name, points) {
    this.#path(name, points.map(({ t, value }) => `M${this.#at(t, value)}m-3-3 6 6m0-6-6 6`).join(""));
  }

  /** Write a text beside a point. @param {string} text @param {Point} point */
  write(text, { t, value }) {
    this.#text("name", text, this.x(t) - 3, this.y(value) - 5, "end");
  }

  #grid() {
    const step = roundStep(((this.#high - this.#low) * LINES_PX) / (HEIGHT - TOP - BOTTOM));
    const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    for (const value of multiples(this.#low, this.#high, step)) {
      this.line("grid", [{ t: -this.#span, value }, { t: 0, value }]);
      this.#text("axis", fixed(value, decimals), LEFT - 6, this.y(value) + 3.5, "end");
    }
    const seconds = roundStep((this.#span * SECONDS_PX) / this.#width);
    for (const t of multiples(-this.#span, 0, seconds)) {
      this.upright("grid", t);
    }
  }

  /** @param {number} t @param {number} value */
  #at(t, value) {
    return `${this.x(t).toFixed(1)} ${this.y(Math.min(this.#high, Math.max(this.#low, value))).toFixed(1)}`;
  }

  /** @param {string} name @param {string} d */
  #path(name, d) {
    const path = document.createElementNS(SVG, "path");
    path.setAttribute("class", name);
    path.setAttribute("d", d);
    this.#svg.append(path);
    return path;
  }

  /** @param {string} name @param {string} text @param {number} x @param {number} y @param {string} anchor */
  #text(name, text, x, y, anchor) {
    const element = document.createElementNS(SVG, "text");
    element.setAttribute("class", name);
    element.setAttribute("x", x.toFixed(1));
    element.setAttribute("y", y.toFixed(1));
    element.setAttribute("text-anchor", anchor);
    element.textContent = text;
    this.#svg.append(element);
  }
}
