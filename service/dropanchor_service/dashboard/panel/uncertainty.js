/** What the uncertainty of the selected tag comes from: a sentence, and a bar for each part. */

import { length } from "../data/format.js";
import { t } from "../i18n/language.js";
import { said } from "../i18n/said.js";
import { element, line } from "../page/elements.js";

/** @typedef {import("../data/evidence.js").Explanation} Explanation */

/** Parts below this share of the whole are not listed. */
const LEAST = 0.1;

/** @param {HTMLElement} box @param {Explanation | null} explanation */
export function showUncertainty(box, explanation) {
  const uncertainty = explanation?.uncertainty;
  box.hidden = !uncertainty;
  if (!uncertainty) return;
  const [sentence, list] = /** @type {[HTMLElement, HTMLElement]} */ ([...box.children]);
  sentence.textContent = said(uncertainty.text, uncertainty.phrase);
  list.replaceChildren(...sharesOf(explanation).map(([name, share]) => lineOf(name, share, share * uncertainty.half_m)));
}

/** Return how large each part is beside the whole, the largest first. @param {Explanation} explanation
 * @returns {[string, number][]} */
function sharesOf({ pose }) {
  /** @type {[string, number][]} */
  const parts = Object.entries(pose.sigma_parts ?? {});
  const whole = Math.hypot(...parts.map(([, part]) => part));
  return parts.map(([name, part]) => /** @type {[string, number]} */ ([name, part / whole])).filter(([, share]) => share >= LEAST).sort((a, b) => b[1] - a[1]);
}

/** @param {string} name @param {number} share @param {number} part_m */
function lineOf(name, share, part_m) {
  const title = t(`part.${name}`);
  const bar = Object.assign(document.createElement("meter"), { value: share, textContent: length(part_m) });
  bar.setAttribute("aria-label", title);
  return line(element("span", title), bar, element("span", `± ${length(part_m)}`));
}
