import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

const PAGE = new URL("../../../service/dropanchor_service/dashboard/", import.meta.url);
globalThis.location = /** @type {any} */ ({ search: "", hash: "" });
const { drawMarkers, drawSelection } = await import(`${PAGE}map/draw_tags.js`);
const { drawEllipses, drawGhosts } = await import(`${PAGE}map/draw_doubt.js`);
const { haloText } = await import(`${PAGE}map/draw_site.js`);
const { COLOURS } = await import(`${PAGE}page/choice.js`);
const { FADE } = await import(`${PAGE}map/scene.js`);
const { STATES } = await import(`${PAGE}data/states.js`);
const { Fleet } = await import(`${PAGE}data/fleet.js`);
const { follow } = await import(`${PAGE}data/motion.js`);
const { View } = await import(`${PAGE}map/view.js`);

const HALO_PX = 1.5;
const VISIBLE = 3; // WCAG 2.2, 1.4.11: between the parts of a graphic
const LEGIBLE = 4.5; // 1.4.3: text

const [light, dark] = readFileSync(new URL("css/colours.css", PAGE), "utf8").split(':root[data-theme="dark"]')
  .map((block) => Object.fromEntries([...block.matchAll(/--([\w-]+): (#[0-9a-f]{6});/g)].map(([, name, colour]) => [name, colour])));

/** @param {Record<string, string>} colours */
const paletteOf = (colours) => ({ ...colours, font: "serif", state: STATES.map((/** @type {any} */ { name }) => colours[name]) });

/** @param {string} colour @returns {number[]} */
const rgb = (colour) => [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));

/** @param {number[]} parts of 255 */
function luminance(parts) {
  const [r, g, b] = parts.map((part) => part / 255).map((part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

/** Return the contrast of a colour of this opacity on its halo. @param {string} colour @param {string} halo @param {number} [alpha] */
function contrast(colour, halo, alpha = 1) {
  const [on, under] = [rgb(colour), rgb(halo)];
  const lit = [on.map((part, i) => alpha * part + (1 - alpha) * under[i]), under].map(luminance).sort((a, b) => a - b);
  return (lit[1] + 0.05) / (lit[0] + 0.05);
}

/** A canvas that notes what is painted, and along which path. */
class NotedCanvas {
  /** @type {{kind: string, path: number, colour: string, width: number, alpha: number}[]} */
  painted = [];
  #path = 0;
  globalAlpha = 1;
  lineWidth = 1;
  strokeStyle = "";
  fillStyle = "";
  beginPath() { this.#path += 1; }
  moveTo() {}
  lineTo() {}
  arc() {}
  ellipse() {}
  closePath() {}
  setLineDash() {}
  stroke() { this.#note("line", this.strokeStyle, this.lineWidth); }
  fill() { this.#note("area", this.fillStyle, 0); }
  strokeText() { this.#note("line", this.strokeStyle, this.lineWidth); }
  fillText() { this.#note("area", this.fillStyle, 0); }
  /** @param {string} kind @param {string} colour @param {number} width */
  #note(kind, colour, width) {
    this.painted.push({ kind, path: this.#path, colour, width, alpha: this.globalAlpha });
  }
}

/** @param {number} age_s of one tag in each state, the ambiguous ones with a hypothesis, without, and selected */
function sceneOf(age_s, /** @type {Record<string, string>} */ colours) {
  const states = [...STATES.map((/** @type {any} */ { name }) => name).filter((/** @type {string} */ name) => name !== "relative"), "ambiguous"];
  const each = (/** @type {any} */ value) => states.map(() => value);
  const fleet = new Fleet();
  fleet.apply(/** @type {any} */ ({
    t_ns: 0, tags: states.map((_, i) => `${i}`), x: states.map((_, i) => i), y: each(0), heading_rad: each(1), state: states,
    age_s: each(age_s), semi_major_m: each(1), semi_minor_m: each(1), angle_rad: each(0),
  }), 0);
  fleet.value.hypotheses[states.length - 1] = [{ x: 1, y: 1, heading_rad: 0, weight: 1 }];
  follow(fleet, 0, false);
  const view = Object.assign(new View(), { x: 0, y: 0, scale: 10, width: 400, height: 400 });
  const rows = Int32Array.from(states, (_, i) => i);
  const ctx = new NotedCanvas();
  const colourOf = (/** @type {number} */ row) => COLOURS[row];
  return /** @type {any} */ ({ ctx, view, palette: paletteOf(colours), fleet, rows, selected: 0, chosen: [0, 1, 2, 3, 4], colourOf, hovered: 1, now_ms: 0 });
}

for (const [theme, colours] of Object.entries({ light, dark })) {
  for (const [stale, age_s] of [0, 3, 60].entries()) {
    test(`${theme}: marks that are ${age_s} s old are visible on their halo, whatever lies below the map`, () => {
      const scene = sceneOf(age_s, colours);
      for (const draw of [drawEllipses, (/** @type {any} */ all) => drawGhosts(all, () => true), drawSelection, drawMarkers]) draw(scene);
      const { painted } = scene.ctx;
      const marks = painted.filter(({ colour, alpha }) => colour !== colours.map && alpha > 0.2); // the tint of an ellipse is none
      assert.ok(marks.length >= 12, `${marks.length}`);
      for (const mark of marks) {
        const halo = painted.find(({ path, kind, colour, alpha }) => path === mark.path && kind === "line" && colour === colours.map && alpha === 1);
        assert.ok(halo && halo.width >= mark.width + 2 * HALO_PX, JSON.stringify({ mark, halo }));
        const seen = contrast(mark.colour, colours.map, mark.alpha);
        assert.ok(seen >= VISIBLE, `${mark.colour} at ${mark.alpha}: ${seen}`);
      }
      assert.ok(marks.some(({ alpha }) => alpha === FADE[stale]));
    });
  }

  test(`${theme}: names are legible on their halo`, () => {
    for (const name of ["ink", "ink-2", "ink-3", "accent", "ambiguous"]) {
      const ctx = new NotedCanvas();
      haloText(/** @type {any} */ (ctx), /** @type {any} */ (colours), "forklift", 0, 0, colours[name]);
      const [halo, text] = ctx.painted;
      assert.ok(halo.colour === colours.map && halo.width >= 2 * HALO_PX && text.colour === colours[name]);
      assert.ok(contrast(text.colour, halo.colour) >= LEGIBLE, name);
    }
  });
}

test("in a crowd only the selected tag has an ellipse with a halo and a fill; the others are thin and faint", () => {
  const scene = sceneOf(0, light);
  scene.rows = Int32Array.from({ length: 40 }, (_, i) => (i === 0 ? 2 : 3)); // rows of tags with an ellipse
  [scene.selected, scene.chosen] = [2, [2]];
  drawEllipses(scene);
  const { painted } = scene.ctx;
  const halos = painted.filter((/** @type {any} */ { colour }) => colour === light.map);
  const faint = painted.filter((/** @type {any} */ { kind, width, alpha }) => kind === "line" && width === 1 && alpha < 0.5);
  assert.equal(halos.length, 1);
  assert.ok(faint.length >= 1 && faint.every((/** @type {any} */ { path }) => path !== halos[0].path));
});
