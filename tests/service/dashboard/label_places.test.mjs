import assert from "node:assert/strict";
import { test } from "node:test";

import { LabelPlaces, placesAround } from "../../../service/dropanchor_service/dashboard/map/label_places.js";

const FREE = [0, 0, 800, 600];

/** @param {string} key @param {number} x @param {number} y */
const name = (key, x, y, must = false, trusted = true) => ({ key, x, y, width: 60, must, trusted });

/** @param {number} x @param {number} y */
const dot = (x, y) => [x - 7, y - 7, x + 7, y + 7];

/** @param {number[]} a @param {number[]} b */
const overlap = (a, b) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];

/** @param {number} count */
function crowd(count) {
  const tags = Array.from({ length: count }, (_, i) => name(`tag-${i}`, 20 + ((i * 137) % 760), 20 + ((i * 71) % 560)));
  return { tags, dots: tags.map(({ x, y }) => dot(x, y)) };
}

test("names in a crowd cover neither dots nor each other, and are few enough to be drawn fast", () => {
  const { tags, dots } = crowd(300);
  const boxes = [...new LabelPlaces().arrange(tags, dots, FREE).values()];
  assert.ok(boxes.length > 20 && boxes.length <= 80, `${boxes.length}`);
  boxes.forEach((box, i) => assert.ok(![...dots, ...boxes.slice(0, i)].some((other) => overlap(box, other)), `${box}`));
});

test("a name has no place where an anchor leaves no room, but that of the selected tag is shown", () => {
  const everywhere = [[0, 0, 800, 600]];
  assert.equal(new LabelPlaces().arrange([name("a", 400, 300)], everywhere, FREE).size, 0);
  const shown = new LabelPlaces().arrange([name("a", 795, 300, true)], everywhere, FREE).get("a") ?? [];
  assert.ok(shown[2] <= 800);
});

test("a name keeps its place although a better one is free again, and moves when it has to", () => {
  const places = new LabelPlaces();
  const tag = [name("a", 100, 100)];
  const [best, second] = placesAround(tag[0]);
  assert.deepEqual(places.arrange(tag, [best], FREE).get("a"), second);
  assert.deepEqual(places.arrange(tag, [], FREE).get("a"), second);
  assert.notDeepEqual(places.arrange(tag, [second], FREE).get("a"), second);
});

test("a tag in trouble takes the place of one that is not, whose name was shown", () => {
  const places = new LabelPlaces();
  const [fine, troubled] = [name("fine", 100, 100), name("troubled", 104, 100, false, false)];
  const [only] = placesAround(fine);
  const around = [[0, 0, 800, only[1] - 4], [0, only[3] + 4, 800, 600], [0, 0, only[0] - 4, 600], [only[2] + 8, 0, 800, 600]];
  assert.deepEqual([...places.arrange([fine], around, FREE).keys()], ["fine"]);
  assert.deepEqual([...places.arrange([fine, { ...troubled, trusted: true }], around, FREE).keys()], ["fine"]);
  assert.deepEqual([...places.arrange([fine, troubled], around, FREE).keys()], ["troubled"]);
});

test("a name that is shown stays when another tag comes near", () => {
  const places = new LabelPlaces();
  const shown = places.arrange([name("b", 100, 100)], [dot(100, 100)], FREE).get("b");
  const both = places.arrange([name("a", 104, 96), name("b", 100, 100)], [dot(100, 100)], FREE);
  assert.deepEqual(both.get("b"), shown);
});

test("a name that just touches another keeps its place, and a new one takes only a place with some room", () => {
  const places = new LabelPlaces();
  const tag = [name("a", 100, 100)];
  const [best] = placesAround(tag[0]);
  const near = [best[2] + 1, best[1], best[2] + 50, best[3]];
  assert.deepEqual(places.arrange(tag, [], FREE).get("a"), best);
  assert.deepEqual(places.arrange(tag, [near], FREE).get("a"), best);
  assert.notDeepEqual(new LabelPlaces().arrange(tag, [near], FREE).get("a"), best);
});
