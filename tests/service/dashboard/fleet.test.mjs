import assert from "node:assert/strict";
import { test } from "node:test";

import { Choice, countStates } from "../../../service/dropanchor_service/dashboard/page/choice.js";
import { Fleet } from "../../../service/dropanchor_service/dashboard/data/fleet.js";
import { follow } from "../../../service/dropanchor_service/dashboard/data/motion.js";
import { Order } from "../../../service/dropanchor_service/dashboard/data/order.js";
import { hasGhosts } from "../../../service/dropanchor_service/dashboard/map/draw_tags.js";
import { isFilled } from "../../../service/dropanchor_service/dashboard/map/shapes.js";
import { STATES, staleness, stateNumber } from "../../../service/dropanchor_service/dashboard/data/states.js";
import { Trails } from "../../../service/dropanchor_service/dashboard/data/trails.js";

/** @param {string[]} tags @param {Record<string, any[]>} columns @returns {any} */
const frame = (tags, columns) => ({ t_ns: 0, tags, ...columns });

/** @param {Fleet} fleet @param {string} column @param {boolean} [descending] */
function sorted(fleet, column, descending = false) {
  return new Order().rows(fleet, () => true, { column, descending }, 0).map((row) => fleet.names[row]);
}

test("a new tag has a row of unknown values", () => {
  const fleet = new Fleet();
  fleet.apply(frame(["a"], {}), 0);
  const row = fleet.row("a");
  assert.ok(Number.isNaN(fleet.number.x[row]) && Number.isNaN(fleet.age(row, 0)));
  assert.equal(STATES[fleet.state[row]].name, "initialising");
  assert.equal(fleet.row("b"), -1);
});

test("a frame changes only the tags that it names", () => {
  const fleet = new Fleet();
  fleet.apply(frame(["a", "b"], { x: [1, 2], state: ["tracking", "lost"], online: [true, false] }), 0);
  fleet.apply(frame(["b"], { x: [5], state: ["tracking"] }), 10);
  assert.deepEqual([...fleet.number.x.slice(0, 2)], [1, 5]);
  assert.deepEqual(countStates(fleet)[stateNumber("tracking")], 2);
  assert.equal(fleet.online[fleet.row("b")], 0);
});

test("null in a column makes a value unknown again", () => {
  const fleet = new Fleet();
  fleet.apply(frame(["a"], { x: [1] }), 0);
  fleet.apply(frame(["a"], { x: [null] }), 1);
  assert.ok(Number.isNaN(fleet.number.x[0]));
});

test("a thousand tags keep their own values while the store grows", () => {
  const fleet = new Fleet();
  const names = Array.from({ length: 1000 }, (_, i) => `t${i}`);
  for (const name of names) fleet.apply(frame([name], { x: [Number(name.slice(1))], reason: [name] }), 0);
  for (const name of names) {
    assert.equal(fleet.number.x[fleet.row(name)], Number(name.slice(1)));
    assert.equal(fleet.value.reason[fleet.row(name)], name);
  }
});

test("a snapshot removes the tags that it does not name", () => {
  const fleet = new Fleet();
  fleet.apply(frame(["a", "b", "c"], { x: [1, 2, 3] }), 0);
  fleet.replace(frame(["c", "d"], { x: [3, 4] }), 0);
  assert.deepEqual(fleet.names, ["c", "d"]);
  assert.equal(fleet.row("a"), -1);
  assert.equal(fleet.number.x[fleet.row("d")], 4);
});

test("the age grows while no frames arrive", () => {
  const fleet = new Fleet();
  fleet.apply(frame(["a"], { age_s: [0.5] }), 1000);
  assert.equal(fleet.age(0, 3000), 2.5);
});

test("a pose that comes late because the tag sends its motion in batches is not stale", () => {
  const fleet = new Fleet();
  fleet.replace(frame(["a", "b"], { age_s: [2.5, 2.5] }), 1000);
  fleet.describe(new Map([["a", { settings: {}, lag_s: 3.1 }]]));
  assert.deepEqual([fleet.staleness(0, 1000), fleet.staleness(1, 1000)], [0, 1]);
});

test("an unknown state is not trusted", () => {
  assert.equal(STATES[stateNumber("splendid")].trusted, false);
});

test("only a fresh pose in tracking is a full dot", () => {
  const full = STATES.filter((_, state) => isFilled(state, staleness(0.1))).map(({ name }) => name);
  assert.deepEqual(full, ["tracking"]);
  for (const age_s of [2.5, 60, NaN]) assert.equal(isFilled(stateNumber("tracking"), staleness(age_s)), false);
});

test("every state has its own shape", () => {
  assert.equal(new Set(STATES.map(({ shape }) => shape)).size, STATES.length);
});

test("names are sorted by their numbers, and unknown values come last in both directions", () => {
  const fleet = new Fleet();
  fleet.apply(frame(["tag-10", "tag-9", "Tag-1"], { x: [3, null, -4] }), 0);
  assert.deepEqual(sorted(fleet, "tag"), ["Tag-1", "tag-9", "tag-10"]);
  assert.deepEqual(sorted(fleet, "x"), ["Tag-1", "tag-10", "tag-9"]);
  assert.deepEqual(sorted(fleet, "x", true), ["tag-10", "Tag-1", "tag-9"]);
});

test("tags are filtered by name and state", () => {
  const fleet = new Fleet();
  const choice = new Choice();
  fleet.apply(frame(["Forklift-1", "cart-1"], { state: ["tracking", "lost"] }), 0);
  choice.text = " fork ";
  assert.deepEqual([choice.shows(fleet, 0), choice.shows(fleet, 1)], [true, false]);
  choice.text = "";
  choice.chooseState(stateNumber("lost"));
  assert.deepEqual([choice.shows(fleet, 0), choice.shows(fleet, 1)], [false, true]);
  choice.showAll();
  assert.ok(choice.shows(fleet, 0) && !choice.isFiltered);
});

test("the map follows no tag while none is selected", () => {
  const choice = new Choice();
  choice.follow = true;
  assert.equal(choice.follow, false);
  choice.select("a");
  choice.follow = true;
  choice.select(null);
  assert.equal(choice.follow, false);
});

test("dots glide to a near pose and jump to a far one", () => {
  const fleet = new Fleet();
  fleet.apply(frame(["a"], { x: [0], y: [0] }), 0);
  follow(fleet, 16, true);
  fleet.apply(frame(["a"], { x: [0.5], y: [0] }), 0);
  assert.equal(follow(fleet, 16, true), true);
  assert.ok(fleet.drawnX[0] > 0 && fleet.drawnX[0] < 0.5);
  fleet.apply(frame(["a"], { x: [9], y: [0] }), 0);
  assert.equal(follow(fleet, 16, true), false);
  assert.equal(fleet.drawnX[0], 9);
});

test("with reduced motion the dots jump to the poses", () => {
  const fleet = new Fleet();
  fleet.apply(frame(["a"], { x: [0], y: [0] }), 0);
  follow(fleet, 16, false);
  fleet.apply(frame(["a"], { x: [0.5], y: [0] }), 0);
  assert.equal(follow(fleet, 16, false), false);
  assert.equal(fleet.drawnX[0], 0.5);
});

test("a trail holds known positions, breaks at unknown ones, and has a limited length", () => {
  const [fleet, trails] = [new Fleet(), new Trails()];
  for (let i = 0; i < 1000; i++) {
    const state = i === 990 ? "ambiguous" : i > 995 ? "degraded" : "tracking";
    fleet.apply(frame(["a"], { x: [i], y: [0], state: [state] }), i * 200);
    trails.note(fleet, ["a"], i * 200);
  }
  const trail = trails.of("a");
  assert.ok(trail && trail.length < 200);
  const points = Array.from({ length: 12 }, (_, i) => trail.at(trail.length - 12 + i));
  assert.deepEqual(points.map((at) => trail.x[at]), [988, 989, NaN, 991, 992, 993, 994, 995, 996, 997, 998, 999]);
  assert.deepEqual(points.map((at) => trail.trusted[at]), [1, 1, 0, 1, 1, 1, 1, 1, 0, 0, 0, 0]);
  trails.prune(new Fleet());
  assert.equal(trails.of("a"), null);
});

test("a track without north is never a full dot, though it says tracking", () => {
  const fleet = new Fleet();
  fleet.apply(frame(["a", "b", "c"], { state: ["tracking", "tracking", "lost"], frame: ["relative", "site", "relative"] }), 0);
  assert.deepEqual(fleet.names.map((_, row) => fleet.style(row).name), ["relative", "tracking", "lost"]);
  assert.equal(fleet.style(0).placed, false);
});

test("the hypotheses of a tag without north are no places of the map", () => {
  const fleet = new Fleet();
  const ghost = [{ weight: 1, x: 1, y: 2, heading_rad: 0, speed_mps: 0 }];
  const both = { state: ["ambiguous", "ambiguous"], frame: ["relative", "site"], hypotheses: [ghost, ghost] };
  fleet.apply(frame(["a", "b"], both), 0);
  assert.deepEqual([0, 1].map((row) => hasGhosts(fleet, row)), [false, true]);
});

test("a lost tag without north is drawn nowhere, since its cross would say where it was", () => {
  const fleet = new Fleet();
  const own = { x: 3, y: 4, heading_rad: 0, hypotheses: [] };
  fleet.apply(frame(["a"], { state: ["lost"], frame: ["relative"], x: [null], y: [null], relative_pose: [own] }), 0);
  assert.deepEqual(fleet.spot(0), [NaN, NaN]);
  fleet.apply(frame(["a"], { state: ["lost"], frame: ["site"], x: [1], y: [2], relative_pose: [null] }), 0);
  assert.deepEqual(fleet.spot(0), [1, 2]);
});

test("a relative tag is drawn where its own frame has it, and has no coordinates of the site", () => {
  const fleet = new Fleet();
  const own = { x: 3, y: 4, heading_rad: 0, hypotheses: [] };
  fleet.apply(frame(["a"], { state: ["relative"], frame: ["relative"], x: [null], y: [null], relative_pose: [own] }), 0);
  follow(fleet, 16, false);
  assert.deepEqual([fleet.style(0).name, fleet.number.x[0], fleet.drawnX[0], fleet.drawnY[0]], ["relative", NaN, 3, 4]);
  fleet.apply(frame(["a"], { state: ["tracking"], frame: ["site"], x: [-3], y: [4], relative_pose: [null] }), 100);
  follow(fleet, 16, false);
  assert.deepEqual([fleet.style(0).name, fleet.number.x[0], fleet.drawnX[0], fleet.ownX[0]], ["tracking", -3, -3, NaN]);
});

test("by name, tags with alarms come first, then warnings, then lost and degraded ones", () => {
  const fleet = new Fleet();
  const state = ["tracking", "degraded", "lost", "tracking", "lost", "coasting"];
  fleet.replace({ t_ns: 0, tags: ["a", "b", "c", "d", "e", "f"], state }, 0);
  const alarmOf = (/** @type {string} */ tag) => ({ d: 2, e: 1 })[tag] ?? 0;
  const rows = new Order().rows(fleet, () => true, { column: "tag", descending: false }, 0, alarmOf);
  assert.deepEqual(rows.map((row) => fleet.names[row]), ["d", "e", "c", "b", "a", "f"]);
});

test("a tag stands since it was seen to stop, or at least since the page knows it", () => {
  const fleet = new Fleet();
  fleet.replace({ t_ns: 0, tags: ["a", "b"], speed_mps: [0, 1] }, 1000);
  fleet.apply({ t_ns: 0, tags: ["a", "b"], speed_mps: [0.05, 0] }, 5000);
  assert.deepEqual([fleet.stoppedFor(0, 9000), fleet.stoppedFor(1, 9000)], [8, 4]);
  assert.deepEqual([fleet.sawStop(0), fleet.sawStop(1)], [false, true]);
  fleet.apply({ t_ns: 0, tags: ["b"], speed_mps: [2] }, 9000);
  assert.ok(Number.isNaN(fleet.stoppedFor(1, 9000)));
});
