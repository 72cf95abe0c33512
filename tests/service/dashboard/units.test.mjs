import assert from "node:assert/strict";
import { test } from "node:test";

globalThis.location = /** @type {any} */ ({ search: "?length=ft", hash: "#velocity=kmh" });
const PAGE = "../../../service/dropanchor_service/dashboard";
const { accuracy, coordinate, distance, half, length, place, speed, withUnits } = await import(`${PAGE}/data/format.js`);
const { readMeasure, units, writeMeasure } = await import(`${PAGE}/data/units.js`);
const { roundLength } = await import(`${PAGE}/map/view.js`);

/** @param {string} measure */
function field(measure) {
  return /** @type {any} */ ({ value: "", dataset: { measure }, get valueAsNumber() { return parseFloat(this.value); } });
}

test("lengths are written in feet and speeds in kilometres per hour", () => {
  assert.equal(length(3.048), "10.00 ft");
  assert.equal(coordinate(335.28), "1100");
  assert.equal(half(-0.001), "0.00");
  assert.equal(distance(3048), "10000 ft");
  assert.equal(accuracy(4.572, 1.524), "± 15.0 ft along, ± 5.00 ft across");
  assert.equal(place(3.048, -3.048, 1), "10.0, −10.0 ft");
  assert.equal(speed(10), "36.00 km/h");
  assert.equal(length(NaN), "–");
  assert.equal(speed(null), "– km/h");
});

test("metres in a sentence of the service are written in feet", () => {
  assert.equal(withUnits("± 3.048 m, of which 0,3048 m come from north. 9 m/s, 2 m², 5 min"), "± 10 ft, of which 1 ft come from north. 9 m/s, 2 m², 5 min");
});

test("the scale of the map is round in the unit of the page", () => {
  assert.equal(distance(roundLength(1)), "5 ft");
});

test("a field keeps the exact measure until somebody types another", () => {
  const input = field("length");
  writeMeasure(input, 1.23);
  assert.equal(input.value, "4.035");
  assert.equal(readMeasure(input), 1.23);
  input.value = "10";
  assert.ok(Math.abs(Number(readMeasure(input)) - 3.048) < 1e-12);
  writeMeasure(input, readMeasure(input));
  assert.equal(input.value, "10");
  writeMeasure(input, null);
  assert.equal(input.value, "");
  assert.equal(readMeasure(input), null);
  assert.equal(units.velocity.symbol, "km/h");
});
