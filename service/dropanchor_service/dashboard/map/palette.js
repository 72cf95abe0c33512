/** Colours for the canvas, read from the style sheet, so that both agree in light and dark. */

import { STATES } from "../data/states.js";

const NAMES = /** @type {const} */ ([
  "map", "grid", "grid-strong", "ink", "ink-2", "ink-3", "ring", "accent", "anchor", "alarm", "warning",
  "base-land", "base-green", "base-water", "base-building", "base-road", "base-line",
]);

/** @typedef {Record<typeof NAMES[number], string> & {state: string[], font: string}} Palette */

/** Return the palette without the colours of the states, for poses that are out of date. @param {Palette} palette @returns {Palette} */
export const withoutStates = (palette) => ({ ...palette, state: palette.state.map(() => palette["ink-3"]) });

/** @returns {Palette} */
export function readPalette() {
  const style = getComputedStyle(document.documentElement);
  const colour = (/** @type {string} */ name) => style.getPropertyValue(`--${name}`).trim();
  return {
    .../** @type {Record<typeof NAMES[number], string>} */ (Object.fromEntries(NAMES.map((name) => [name, colour(name)]))),
    state: STATES.map((state) => colour(state.name)),
    font: colour("font"),
  };
}
