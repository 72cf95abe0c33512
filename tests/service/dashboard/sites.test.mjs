import assert from "node:assert/strict";
import { test } from "node:test";

import { MAP, dots, listed } from "../../../service/dropanchor_service/dashboard/sites/overview.js";

const site = (/** @type {string} */ id, more = {}) => ({ site: id, name: "", georeference: null, tags: 0, online: 0, states: {}, needs_care: 0, ...more });
const at = (/** @type {string} */ id, /** @type {number} */ lat, /** @type {number} */ lon) => site(id, { georeference: { lat, lon } });

test("sites that need care come first, then all by name, and a text finds names and ids", () => {
  const sites = [site("b", { name: "Zoo" }), site("c"), site("a", { needs_care: 2, name: "Yard" }), site("d", { name: "Annexe" })];
  assert.deepEqual(listed(sites, "").map((one) => one.site), ["a", "d", "c", "b"]);
  assert.deepEqual(listed(sites, " ZO").map((one) => one.site), ["b"]);
  assert.deepEqual(listed(sites, "d").map((one) => one.site), ["a", "d"]);
});

test("the map has north up, east right and the sites of Earth alone", () => {
  const [berlin, munich, hamburg] = dots([at("berlin", 52.5, 13.4), at("munich", 48.1, 11.6), site("nowhere"), at("hamburg", 53.6, 10.0)]);
  assert.ok(berlin.y < munich.y && hamburg.y < berlin.y);
  assert.ok(berlin.x > munich.x && hamburg.x < munich.x);
  for (const { x, y } of [berlin, munich, hamburg]) assert.ok(x >= MAP.margin && x <= MAP.width - MAP.margin && y >= MAP.margin - 1e-9 && y <= MAP.height - MAP.margin + 1e-9);
  assert.deepEqual(dots([site("nowhere")]), []);
});

test("one site lies in the middle, and sites beside the date line lie side by side", () => {
  assert.deepEqual(dots([at("only", -90, 0)]).map(({ x, y }) => [x, y]), [[MAP.width / 2, MAP.height / 2]]);
  const [fiji, samoa] = dots([at("fiji", -18, 179.5), at("samoa", -18, -172)]);
  assert.ok(fiji.x < samoa.x);
});
