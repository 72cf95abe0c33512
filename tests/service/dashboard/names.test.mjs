import assert from "node:assert/strict";
import { test } from "node:test";

import { shortened } from "../../../service/dropanchor_service/dashboard/data/names.js";

/** Every letter is one wide. @param {string} name @param {number} room */
const within = (name, room) => shortened(name, room, (text) => [...text].length);

test("a name that fits is not changed", () => {
  assert.equal(within("forklift-7", 10), "forklift-7");
});

test("a long name keeps its start and more of its end", () => {
  assert.equal(within("warehouse-forklift-north-17", 11), "war…orth-17");
});

test("the shortest form of a name keeps its last letter", () => {
  assert.equal(within("forklift-7", 0), "…7");
});

test("characters of two code units are not split", () => {
  assert.equal(within("🚜🚜🚜🚜🚜🚜", 3), "…🚜🚜");
});
