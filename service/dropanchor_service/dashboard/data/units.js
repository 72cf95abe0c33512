/** The units in which the page writes lengths and speeds, and in which people type them. All other code has m and m/s. */

import { chosen } from "./display.js";

/** @typedef {{symbol: string, factor: number}} Unit factor: of this unit in one SI unit */

const M_PER_FT = 0.3048;
const M_PER_MILE = 1609.344;

/** The units to choose from, by their names in the address. @type {{length: Record<string, Unit>, velocity: Record<string, Unit>}} */
export const UNITS = {
  length: { m: { symbol: "m", factor: 1 }, ft: { symbol: "ft", factor: 1 / M_PER_FT } },
  velocity: {
    mps: { symbol: "m/s", factor: 1 }, kmh: { symbol: "km/h", factor: 3.6 }, mph: { symbol: "mph", factor: 3600 / M_PER_MILE },
  },
};

/** The names of the units that the page uses. */
export const unitNames = {
  length: chosen("length", Object.keys(UNITS.length)) ?? "m",
  velocity: chosen("velocity", Object.keys(UNITS.velocity)) ?? "mps",
};

/** The units that the page uses. */
export const units = { length: UNITS.length[unitNames.length], velocity: UNITS.velocity[unitNames.velocity], angle: { symbol: "°", factor: 180 / Math.PI } };

/** Whether the page uses SI units, as files and interfaces do. */
export const isSi = units.length.factor === 1 && units.velocity.factor === 1;

/** @typedef {keyof typeof units} Kind */

/** @param {HTMLInputElement} input @returns {Unit} */
const unitOf = (input) => units[/** @type {Kind} */ (input.dataset.measure)];

/** Write symbols into the elements that ask for them, and convert the limits of the fields that hold measures. @param {ParentNode} page */
export function installUnits(page) {
  for (const element of page.querySelectorAll("[data-unit]")) {
    element.textContent = units[/** @type {Kind} */ (/** @type {HTMLElement} */ (element).dataset.unit)].symbol;
  }
  for (const input of /** @type {NodeListOf<HTMLInputElement>} */ (page.querySelectorAll("input[data-measure]"))) {
    for (const limit of /** @type {const} */ (["min", "max"])) {
      if (input[limit] !== "") input[limit] = typed(Number(input[limit]), unitOf(input));
    }
  }
}

/** Write a measure into a field, unless it shows it already. It keeps the exact value. @param {HTMLInputElement} input
 * @param {number | null} value in SI units; null: unknown */
export function writeMeasure(input, value) {
  const isShown = readMeasure(input) === value && (value !== null || input.value === "");
  if (!isShown) input.value = value === null ? "" : typed(value, unitOf(input));
  input.dataset.shown = input.value;
  input.dataset.exact = value === null ? "" : String(value);
}

/** Return the measure in a field in SI units: the exact one while nobody has typed another; null when there is none.
 * @param {HTMLInputElement} input */
export function readMeasure(input) {
  if (input.value === "" || Number.isNaN(input.valueAsNumber)) return null;
  if (input.value === input.dataset.shown) return Number(input.dataset.exact);
  return input.valueAsNumber / unitOf(input).factor;
}

/** Return a measure with its unit, as a person would type it. @param {number} value in SI units @param {Kind} kind */
export const measureText = (value, kind) => `${typed(value, units[kind])} ${units[kind].symbol}`;

/** Return a value as a person would type it. @param {number} value in SI units @param {Unit} unit */
const typed = (value, { factor }) => String(factor === 1 ? value : Number((value * factor).toFixed(3)));
