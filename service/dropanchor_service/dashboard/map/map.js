/** The live map: one canvas that is redrawn only when something has changed. */

import { drawAnchors, drawGrid, drawRings, drawScaleBar } from "./draw_site.js";
import { drawEvidence } from "./draw_evidence.js";
import { drawTurn } from "./draw_turn.js";
import { drawEllipses, drawGhosts, drawRangeRings, drawTrails } from "./draw_doubt.js";
import { Labels } from "./draw_labels.js";
import { drawColours, drawElsewhere, drawMarkers, drawSelection } from "./draw_tags.js";
import { DENSITY_ABOVE, drawDensity } from "./density.js";
import { drawTrack } from "./draw_track.js";
import { follow } from "../data/motion.js";
import { MOST_TRACKS } from "../data/chosen_tracks.js";
import { union } from "./outside.js";
import { placesToFit } from "./places_to_fit.js";
import { readPalette, withoutStates } from "./palette.js";
import { nearest, rowsInView } from "./scene.js";
import { LAYERS, Ticks } from "../data/ticks.js";
import { Stamps } from "./stamps.js";
import { View, boundsAround, limited } from "./view.js";

const SMOOTH_UP_TO = 1000;
const MIN_FIT_M = 6;
const FIT_PADDING_PX = 64;
/** Share of the padding. A tag that comes closer to the edge makes the map fit all tags again. */
const FIT_AGAIN = 0.75;
/** Followed tags that would be drawn so many times larger make the map zoom in. */
const ZOOM_IN_AT = 2.5;
const REACH_PX = 18;
const GLIDE_MS = 90;

export class LiveMap extends EventTarget {
  view = new View();
  palette = readPalette();
  /** @type {readonly import("./draw_site.js").Anchor[]} */
  anchors = [];
  hovered = -1;
  /** Boxes of buttons on the map that no name may stand below. @type {number[][]} */
  hints = [];
  layers = new Ticks("layers", LAYERS);
  /** Draw on the grid, below everything else. @type {((scene: import("./scene.js").Scene) => void)[]} */
  underlays = [];
  /** Draw over everything else. @type {((scene: import("./scene.js").Scene) => void)[]} */
  overlays = [];
  /** Return the track of a selected tag. @type {(tag: string | null) => import("../data/tracks.js").Track | null | undefined} */
  trackOf = () => null;
  /** Return whether a click was meant for something else than the tags. */
  pressed = (/** @type {number} */ _px, /** @type {number} */ _py) => false;
  /** Return whether a tag is on a floor that the map does not show. */
  isElsewhere = (/** @type {number} */ _row) => false;
  /** Keep all tags in view until the user moves the map. */
  autoFit = true;
  /** For tests and the console: figures of the last drawing. */
  stats = { drawings: 0, ms: 0, visible: 0, elsewhere: 0, density: false, labels: /** @type {number[][]} */ ([]) };
  #ctx;
  #labels = new Labels();
  #stamps = new Stamps();
  #rows = new Int32Array(0);
  #isScheduled = false;
  #last = 0;
  /** @type {{x: number, y: number, scale: number} | null} */
  #goal = null;
  #reducedMotion = matchMedia("(prefers-reduced-motion: reduce)");

  /** @param {HTMLCanvasElement} canvas @param {HTMLElement} tools buttons on the right of it
   * @param {import("../data/fleet.js").Fleet} fleet
   * @param {import("../data/trails.js").Trails} trails @param {import("../data/roster.js").Roster} roster
   * @param {import("../page/choice.js").Choice} choice @param {import("../data/evidence.js").Evidence} evidence */
  constructor(canvas, tools, fleet, trails, roster, choice, evidence) {
    super();
    this.canvas = canvas;
    this.tools = tools;
    this.fleet = fleet;
    this.trails = trails;
    this.roster = roster;
    this.choice = choice;
    this.evidence = evidence;
    this.#ctx = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    new ResizeObserver(() => this.#resize()).observe(canvas);
    choice.addEventListener("change", () => this.redraw());
    for (const source of [evidence, this.layers]) source.addEventListener("change", () => this.redraw());
  }

  /** Whether the map is up to date: no drawing is scheduled, and the view does not move. */
  get still() {
    return !this.#isScheduled && this.#goal === null;
  }

  /** @param {readonly import("./draw_site.js").Anchor[]} anchors */
  setAnchors(anchors) {
    if (JSON.stringify(anchors) === JSON.stringify(this.anchors)) return;
    this.anchors = anchors;
    if (this.autoFit) this.#aimAtAll();
    this.redraw();
  }

  redraw() {
    if (this.#isScheduled) return;
    this.#isScheduled = true;
    requestAnimationFrame((now_ms) => this.#frame(now_ms));
  }

  /** Read the colours of the page again and redraw. */
  recolour() {
    this.palette = readPalette();
    this.redraw();
  }

  /** Stop fitting and following, because the user moves the map. */
  takeOver() {
    this.autoFit = false;
    this.#goal = null;
    this.choice.follow = false;
    this.dispatchEvent(new Event("view"));
    this.redraw();
  }

  fitAll() {
    this.autoFit = true;
    this.choice.follow = false;
    this.#aimAtAll();
    this.dispatchEvent(new Event("view"));
    this.redraw();
  }

  /** Show a part of the plane. @param {number} x m, of the centre @param {number} y m @param {number} scale pixels per metre */
  show(x, y, scale) {
    Object.assign(this.view, { x, y, scale: limited(scale) });
    this.takeOver();
  }

  /** Show a part of the plane beside what is visible. @param {import("./view.js").Bounds} bounds */
  showToo(bounds) {
    this.takeOver();
    this.#goal = this.view.fitted(union(this.view.free(this.#padding), bounds), this.#padding);
    this.redraw();
  }

  /** Return whether the filters show a tag, on this floor. @param {number} row */
  isShown(row) {
    return this.choice.shows(this.fleet, row) && !this.isElsewhere(row);
  }

  /** @param {number} factor @param {number} [px] @param {number} [py] */
  zoom(factor, px = this.view.width / 2, py = this.view.height / 2) {
    this.autoFit = false;
    this.#goal = null;
    this.view.zoomAt(factor, px, py);
    this.dispatchEvent(new Event("view"));
    this.redraw();
  }

  /** Bring a tag into view. @param {number} row */
  reveal(row) {
    const [x, y] = this.fleet.spot(row);
    const seen = this.view.bounds(-40);
    if (this.autoFit || Number.isNaN(x + y) || (x > seen.left && x < seen.right && y > seen.bottom && y < seen.top)) return;
    this.#goal = { x, y, scale: this.view.scale };
    this.redraw();
  }

  /** Return the rows of the tags in a part of the screen, in pixels. @param {import("./view.js").Bounds} box its top is above its bottom */
  tagsIn({ left, right, top, bottom }) {
    const { view, fleet } = this;
    return [...this.#rows].filter((row) => {
      const [px, py] = [view.screenX(fleet.drawnX[row]), view.screenY(fleet.drawnY[row])];
      return px >= left && px <= right && py >= top && py <= bottom;
    });
  }

  /** Return the row of the tag at a point on the screen; −1: none. @param {number} px @param {number} py */
  tagAt(px, py) {
    return nearest(this.fleet, this.view, this.#rows, px, py, REACH_PX);
  }

  #resize() {
    const { clientWidth, clientHeight } = this.canvas;
    this.view.width = Math.max(1, clientWidth);
    this.view.height = Math.max(1, clientHeight);
    this.view.covered = this.tools.offsetWidth === 0 ? 0 : clientWidth - this.tools.offsetLeft; // none on a wall
    this.canvas.width = Math.round(clientWidth * this.#pixelRatio);
    this.canvas.height = Math.round(clientHeight * this.#pixelRatio);
    if (this.autoFit) this.#aimAtAll();
    this.redraw();
  }

  /** @param {number} now_ms */
  #frame(now_ms) {
    const begun = performance.now();
    this.#isScheduled = false;
    const elapsed_ms = Math.min(100, now_ms - this.#last);
    this.#last = now_ms;
    const smooth = !this.#reducedMotion.matches && this.fleet.size <= SMOOTH_UP_TO;
    const moving = follow(this.fleet, elapsed_ms, smooth);
    const gliding = this.#moveView(elapsed_ms);
    this.#draw(performance.now());
    this.stats = { ...this.stats, drawings: this.stats.drawings + 1, ms: performance.now() - begun };
    if (moving || gliding) this.redraw();
  }

  /** @param {number} elapsed_ms */
  #moveView(elapsed_ms) {
    const row = this.fleet.row(this.choice.selected);
    if (this.choice.follow && this.choice.several.length > 0) this.#keepInView(this.choice.several);
    else if (this.choice.follow && row >= 0 && !Number.isNaN(this.fleet.drawnX[row])) {
      this.#goal = { x: this.fleet.drawnX[row], y: this.fleet.drawnY[row], scale: this.view.scale };
    } else if (this.autoFit && this.#somethingOutside()) {
      this.#aimAtAll();
    }
    if (!this.#goal) return false;
    const share = this.#reducedMotion.matches ? 1 : 1 - Math.exp(-elapsed_ms / GLIDE_MS);
    const far = Math.hypot(this.#goal.x - this.view.x, this.#goal.y - this.view.y) * this.view.scale;
    const arrived = share === 1 || (far < 0.5 && Math.abs(Math.log(this.#goal.scale / this.view.scale)) < 0.002);
    const step = arrived ? 1 : share;
    this.view.x += step * (this.#goal.x - this.view.x);
    this.view.y += step * (this.#goal.y - this.view.y);
    this.view.scale *= (this.#goal.scale / this.view.scale) ** step;
    if (arrived) this.#goal = null;
    return !arrived;
  }

  /** Move and zoom so that all these tags are in view, and only when one of them leaves it or they have become small.
   * @param {readonly string[]} tags */
  #keepInView(tags) {
    const bounds = boundsAround(tags.map((tag) => this.fleet.spot(this.fleet.row(tag))), MIN_FIT_M);
    if (!bounds) return;
    const [seen, goal] = [this.view.free(FIT_AGAIN * this.#padding), this.view.fitted(bounds, this.#padding)];
    const isInside = bounds.left >= seen.left && bounds.right <= seen.right && bounds.bottom >= seen.bottom && bounds.top <= seen.top;
    if (!isInside || goal.scale > ZOOM_IN_AT * this.view.scale) this.#goal = goal;
  }

  #somethingOutside() {
    const seen = this.view.free(FIT_AGAIN * this.#padding);
    for (const [x, y] of placesToFit(this.anchors, this.fleet, this.choice)) {
      if (x < seen.left || x > seen.right || y < seen.bottom || y > seen.top) return true;
    }
    return false;
  }

  #aimAtAll() {
    const bounds = boundsAround(placesToFit(this.anchors, this.fleet, this.choice), MIN_FIT_M);
    this.#goal = this.view.fitted(bounds ?? { left: -5, right: 5, bottom: -5, top: 5 }, this.#padding);
  }

  /** Pixels of the canvas for a pixel of the style sheet, also where that zooms the page. */
  get #pixelRatio() {
    return devicePixelRatio * (this.canvas.currentCSSZoom ?? 1);
  }

  get #padding() {
    return Math.min(FIT_PADDING_PX, this.view.width / 6, this.view.height / 6);
  }

  /** @param {number} now_ms */
  #draw(now_ms) {
    const { view, fleet, choice } = this;
    const palette = fleet.current ? this.palette : withoutStates(this.palette);
    this.#rows = rowsInView(fleet, view, (row) => choice.shows(fleet, row));
    const [here, elsewhere] = [this.#rows.filter((row) => !this.isElsewhere(row)), this.#rows.filter(this.isElsewhere)];
    const scene = {
      ctx: this.#ctx, view, palette, fleet, trails: this.trails, roster: this.roster, anchors: this.anchors,
      rows: here, selected: fleet.row(choice.selected), chosen: choice.tags.map((tag) => fleet.row(tag)).filter((row) => row >= 0), hovered: this.hovered, now_ms,
      colourOf: (/** @type {number} */ row) => choice.colourOf(fleet.names[row]),
    };
    this.#ctx.setTransform(this.#pixelRatio, 0, 0, this.#pixelRatio, 0, 0);
    this.#ctx.clearRect(0, 0, view.width, view.height);
    drawGrid(this.#ctx, view, palette);
    for (const draw of this.underlays) draw(scene);
    const centre = this.anchors.find((anchor) => anchor.id === fleet.value.anchor[scene.selected]) ?? this.anchors[0];
    if (centre && this.layers.isShown("rings")) drawRings(this.#ctx, view, palette, centre);
    drawElsewhere(scene, elsewhere);
    this.stats.elsewhere = elsewhere.length;
    this.#drawTags(scene, (row) => this.isShown(row));
    for (const draw of this.overlays) draw(scene);
    drawScaleBar(this.#ctx, view, palette);
  }

  /** @param {import("./scene.js").Scene} scene @param {(row: number) => boolean} isShown */
  #drawTags(scene, isShown) {
    const density = scene.rows.length > DENSITY_ABOVE;
    this.stats = { ...this.stats, visible: scene.rows.length, density };
    drawRangeRings(scene, isShown);
    const only = { ...scene, rows: Int32Array.from(scene.chosen) };
    const of = (/** @type {string} */ layer) => (this.layers.isShown(layer) ? scene : only);
    if (density) drawDensity(scene);
    else drawEllipses(of("ellipses"));
    drawTurn(scene, this.evidence.of(this.choice.selected));
    drawEvidence(scene, this.evidence.of(this.choice.selected));
    for (const tag of this.choice.tags.slice(0, MOST_TRACKS)) {
      const track = this.trackOf(tag);
      if (track) drawTrack(scene, track, this.choice.colourOf(tag));
    }
    drawTrails(of("trails"));
    drawAnchors(scene.ctx, scene.view, scene.palette, scene.anchors);
    drawGhosts(scene, isShown);
    const apart = density ? only : scene;
    drawSelection(apart);
    this.stats.labels = this.#labels.draw(density ? only : of("names"), this.hints);
    drawMarkers(apart, this.#stamps);
    drawColours(apart); // above the halos of the dots
  }
}
