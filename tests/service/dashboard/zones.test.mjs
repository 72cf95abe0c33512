import assert from "node:assert/strict";
import { test } from "node:test";

import { newId } from "../../../service/dropanchor_service/dashboard/zones/editor.js";
import { newestFirst, retractedBy } from "../../../service/dropanchor_service/dashboard/zones/event_log.js";
import { handlesOf, isInside, movedTo, placeIn, withCorner, withoutCorner } from "../../../service/dropanchor_service/dashboard/zones/shape_edit.js";
import { clock, probability, sentence } from "../../../service/dropanchor_service/dashboard/zones/words.js";

const SQUARE = { type: "polygon", points: [[0, 0], [4, 0], [4, 4], [0, 4]] };
const DATA = {
  t_ns: 305e9, since_ns: 5e9, zone: "yard", rule: null, name: "Yard", probability: 0.999, other_tag: "b",
  distance_m: 2.14, speed_mps: 2.31, battery_fraction: 0.14,
};
const event = (type, data = {}) => ({ type, subject: "a", time: "2027-01-15T08:00:00.000000Z", sequence: "1", data: { ...DATA, ...data } });

test("a sentence has the name, the time and the measures of its event", () => {
  const sentences = {
    "zone.enter": "a entered Yard", "zone.dwell": "a has been in Yard for 5 min", "zone.speed": "a is too fast in Yard: 2.3 m/s",
    "tags.too_close": "a and b are too close: 2.1 m", "tag.battery_low": "The battery of a is low: 14 %",
  };
  for (const [type, text] of Object.entries(sentences)) assert.equal(sentence(event(`dropanchor.${type}`)), text);
  assert.equal(sentence(event("dropanchor.zone.enter", { name: "" })), "a entered yard");
});

test("a place is in a zone by its shape and its heights", () => {
  const [all, low] = [{ z_min_m: null, z_max_m: null }, { z_min_m: null, z_max_m: 2 }];
  const bay = { type: "polygon", points: [[0, 0], [4, 0], [4, 4], [2, 1], [0, 4]] };
  const disc = { type: "circle", x: 1, y: 1, radius_m: 1 };
  for (const [shape, x, y, is] of [[bay, 1, 1, true], [bay, 2, 2, false], [bay, 5, 1, false], [disc, 1.7, 1.7, true], [disc, 1.8, 1.8, false]]) {
    assert.equal(isInside({ shape, ...all }, x, y, NaN), is, `${x}, ${y}`);
  }
  assert.deepEqual([1, 3, NaN].map((z) => isInside({ shape: disc, ...low }, 1, 1, z)), [true, false, true]);
});

test("an event that is not true is struck through, and the one that says so says why", () => {
  const retraction = event("dropanchor.event.retracted", { retracts: "5f", retracted_type: "dropanchor.zone.enter", reason: "start_denied" });
  assert.equal(sentence(retraction), "Retracted for a: Entered a zone (Yard): the ranges contradict its start");
  assert.deepEqual([...retractedBy([retraction, event("dropanchor.zone.enter")])], [["5f", "start_denied"]]);
});

test("a probability is never rounded up to one", () => {
  assert.equal(probability(event("", {})), "P 0.99");
  assert.equal(probability(event("", { probability: 1 })), "P 1.00");
  assert.equal(probability(event("", { probability: null })), "");
});

test("an event of another day has a date", () => {
  const at = new Date("2027-01-15T08:00:00Z");
  assert.match(clock(event(""), at), /^\d\d:00:00$/);
  assert.match(clock(event(""), new Date("2027-02-15T08:00:00Z")), /^1[456] Jan 2027, \d\d:00:00$/);
});

test("events are listed once each, newest first, and not without end", () => {
  const numbered = (...numbers) => numbers.map((sequence) => ({ sequence }));
  assert.deepEqual(newestFirst(numbered(3, 4), numbered(3, 2)), numbered(4, 3, 2));
  assert.equal(newestFirst(numbered(...Array(300).keys()), []).length, 100);
});

test("an edge that is moved becomes two edges around a new corner", () => {
  const edge = handlesOf(SQUARE).find(({ kind, index }) => kind === "edge" && index === 3);
  assert.deepEqual([edge.x, edge.y], [0, 2]);
  assert.deepEqual(movedTo(SQUARE, edge, -1, 2).points, [...SQUARE.points, [-1, 2]]);
});

test("corners are moved, added and removed, to the centimetre", () => {
  assert.deepEqual(movedTo(SQUARE, { kind: "corner", index: 1 }, 5.123, 0).points[1], [5.12, 0]);
  assert.deepEqual(withCorner(SQUARE, 1, 1).points.length, 5);
  assert.deepEqual(withoutCorner(SQUARE, 0).points, SQUARE.points.slice(1));
});

test("a circle is moved by its centre and sized by its edge", () => {
  const circle = { type: "circle", x: 1, y: 1, radius_m: 2 };
  assert.deepEqual(movedTo(circle, { kind: "centre", index: 0 }, 3, 4), { ...circle, x: 3, y: 4 });
  assert.deepEqual(movedTo(circle, { kind: "radius", index: 0 }, 4, 5), { ...circle, radius_m: 5 });
  assert.equal(movedTo(circle, { kind: "radius", index: 0 }, 1, 1).radius_m, 0.1);
});

test("the place that a refusal names is found", () => {
  const refusal = (values) => ({ type: "", detail: "", detail_phrase: { code: "at", values } });
  assert.deepEqual(placeIn(refusal({ "what.place": "1.5, -2" })), [1.5, -2]);
  assert.equal(placeIn(refusal({ "what.area": "0.01" })), null);
});

test("the id of a new zone is made of its name and is free", () => {
  assert.equal(newId("Loading dock!", []), "loading-dock");
  assert.equal(newId("Dock", [{ id: "dock" }, { id: "dock-2" }]), "dock-3");
  assert.equal(newId("駅", []), "zone");
});
