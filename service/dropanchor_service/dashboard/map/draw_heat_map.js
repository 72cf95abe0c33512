/** Draw a heat map below the tags, in colours that people with every kind of colour vision can order. */

const STEPS = 24;
const ALPHA = [0.45, 0.85];
/** After cividis by Nuñez, Anderton and Renslow (PLOS ONE 13(7), 2018): lightness and hue rise evenly, also for people
 * who do not tell red from green. Here from the largest value in the light theme to the largest in the dark one. */
const COLOURS = ["#00204d", "#31446b", "#666970", "#958f78", "#cab969", "#ffea46"].map((colour) => [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16)));

/** Return the colour of a place on the scale: the more, the further from the colour of the map. @param {number} share 0 to 1
 * @param {boolean} isDark */
export function heatColour(share, isDark) {
  const place = (isDark ? share : 1 - share) * (COLOURS.length - 1);
  const at = Math.min(COLOURS.length - 2, Math.floor(place));
  const [red, green, blue] = COLOURS[at].map((from, i) => Math.round(from + (place - at) * (COLOURS[at + 1][i] - from)));
  return `rgb(${red} ${green} ${blue} / ${(ALPHA[0] + share * (ALPHA[1] - ALPHA[0])).toFixed(2)})`;
}

export class HeatPainter {
  /** @type {import("../data/heat_map.js").Heat | null} */
  #heat = null;
  /** The cells of each colour, in metres. @type {Path2D[]} */
  #paths = [];

  /** @param {import("../data/heat_map.js").HeatMap} map @param {import("./scene.js").Scene} scene */
  draw({ heat, scale }, { ctx, view }) {
    if (!heat || !scale) return;
    if (heat !== this.#heat) [this.#heat, this.#paths] = [heat, pathsOf(heat, scale)];
    const isDark = document.documentElement.dataset.theme === "dark";
    ctx.save();
    ctx.transform(view.scale, 0, 0, -view.scale, view.screenX(0), view.screenY(0));
    this.#paths.forEach((path, step) => {
      ctx.fillStyle = heatColour(step / (STEPS - 1), isDark);
      ctx.fill(path);
    });
    ctx.restore();
  }
}

/** @param {import("../data/heat_map.js").Heat} heat @param {import("../data/heat_map.js").Scale} scale */
function pathsOf({ cell_m, cells }, scale) {
  const paths = Array.from({ length: STEPS }, () => new Path2D());
  cells.seconds.forEach((seconds, i) => {
    paths[Math.round(scale.of(seconds) * (STEPS - 1))].rect(cells.x[i] - cell_m / 2, cells.y[i] - cell_m / 2, cell_m, cell_m);
  });
  return paths;
}
