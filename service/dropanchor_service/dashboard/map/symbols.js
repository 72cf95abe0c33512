/** The symbols of index.html. */

const SVG = "http://www.w3.org/2000/svg";

/** Return the marker of a state as an SVG element. @param {string} state @returns {{svg: SVGSVGElement, use: SVGUseElement}} */
export function symbol(state) {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("class", "symbol");
  svg.setAttribute("aria-hidden", "true");
  const use = document.createElementNS(SVG, "use");
  use.setAttribute("href", `#s-${state}`);
  svg.append(use);
  return { svg, use };
}
