import assert from "node:assert/strict";
import { test } from "node:test";

import { unreadable } from "../../../service/dropanchor_service/dashboard/alerts/item_editor.js";
import { ChangedMeanwhileError, UnreachableError } from "../../../service/dropanchor_service/dashboard/data/access.js";
import { Trails } from "../../../service/dropanchor_service/dashboard/data/trails.js";
import { UndoStack } from "../../../service/dropanchor_service/dashboard/data/undo.js";
import { zoneChange } from "../../../service/dropanchor_service/dashboard/zones/words.js";

/** Return a stack, a value that `set` changes with a step each, and what the stack told. */
function bench() {
  const history = new UndoStack();
  const told = [];
  for (const name of ["done", "undone", "redone", "failed"]) history.addEventListener(name, ({ detail }) => told.push(`${name} ${detail.what}`));
  const one = { value: 0, history, told };
  const swap = (to) => {
    const from = one.value;
    one.value = to;
    return () => swap(from);
  };
  one.set = (to, more = {}) => history.push({ what: `${to}`, back: swap(to), ...more });
  return one;
}

test("steps are undone newest first, and done again in their order", async () => {
  const one = bench();
  one.set(1);
  one.set(2);
  await Promise.all([one.history.undo(), one.history.undo()]);
  assert.equal(one.value, 0);
  await one.history.redo();
  assert.equal(one.value, 1);
  await one.history.redo();
  await one.history.redo();
  assert.equal(one.value, 2);
  assert.deepEqual(one.told, ["done 1", "done 2", "undone 2", "undone 1", "redone 1", "redone 2"]);
});

test("something new ends what could be done again", async () => {
  const one = bench();
  one.set(1);
  await one.history.undo();
  one.set(2);
  await one.history.redo();
  assert.equal(one.value, 2);
});

test("a step that somebody else has overtaken is dropped, one that the service did not get is kept", async () => {
  const one = bench();
  one.set(1);
  let error = new UnreachableError();
  one.history.push({ what: "theirs", back: () => Promise.reject(error) });
  await one.history.undo();
  error = new ChangedMeanwhileError({ type: "", detail: "" });
  await one.history.undo();
  await one.history.undo();
  assert.equal(one.value, 0);
  assert.deepEqual(one.told.slice(2), ["failed theirs", "failed theirs", "undone 1"]);
});

test("a step that cannot be undone says why, once", async () => {
  const one = bench();
  one.set(1);
  one.set(2, { refusal: "Nobody can." });
  let why;
  one.history.addEventListener("failed", ({ detail }) => (why = detail.error.message));
  await one.history.undo();
  assert.deepEqual([one.value, why], [2, "Nobody can."]);
  await one.history.undo();
  assert.equal(one.told.at(-1), "undone 1");
});

test("what was done at once is undone at once", async () => {
  const one = bench();
  const together = {};
  one.set(1);
  one.set(2, { together });
  one.set(3, { together });
  await one.history.undo();
  assert.equal(one.value, 1);
  await one.history.redo();
  assert.equal(one.value, 3);
  assert.deepEqual(one.told.slice(3), ["undone 2", "redone 3"]);
});

test("the steps of a draft are forgotten with it", async () => {
  const one = bench();
  const draft = {};
  one.set(1);
  one.set(2, { owner: draft });
  one.set(3, { owner: draft });
  await one.history.undo();
  one.history.forget(draft);
  await one.history.redo();
  assert.equal(one.value, 2);
  await one.history.undo();
  assert.deepEqual(one.told.at(-1), "undone 1");
  assert.ok(one.history.isEmpty === false);
});

test("a change of a zone is said in words", () => {
  const circle = { type: "circle", x: 0, y: 0, radius_m: 2 };
  const ramp = { id: "ramp", name: "Ramp", shape: circle, dwell_s: null };
  const said = (changes) => zoneChange(ramp, { ...ramp, ...changes });
  assert.equal(zoneChange(null, ramp), "Zone Ramp added.");
  assert.equal(zoneChange(ramp, null), "Zone Ramp deleted.");
  assert.equal(said({ name: "Gate" }), "Zone Ramp renamed to Gate.");
  assert.equal(said({ shape: { ...circle, x: 1 } }), "Zone Ramp moved.");
  assert.equal(said({ shape: { ...circle, radius_m: 1 } }), "Shape of zone Ramp changed.");
  assert.equal(said({ dwell_s: 5, name: "Gate" }), "Zone Gate changed.");
});

test("a change of a destination cannot be undone when nobody can read what was there before", () => {
  const before = { type: "webhook", url: "https://mes.example.com/…", secret: null, tags: [] };
  assert.equal(unreadable(before, { ...before, tags: ["a"] }), "");
  assert.match(unreadable(before, { ...before, secret: "whsec_" }), /cannot be undone/);
  assert.match(unreadable(before, { ...before, url: "https://mes.example.com/b" }), /cannot be undone/);
  assert.equal(unreadable({ ...before, url: "https://a.example.com" }, { ...before, url: "https://b.example.com/c" }), "");
});

test("a trail forgets where a tag was since a wrong start", () => {
  const trails = new Trails();
  const fleet = { row: () => 0, state: [2], number: { x: [0], y: [0] } };
  for (let i = 0; i < 5; i++) {
    fleet.number.x[0] = i;
    trails.note(fleet, ["cart"], i * 1000);
  }
  trails.forget("cart", 3000);
  const trail = trails.of("cart");
  assert.deepEqual(Array.from({ length: trail.length }, (_, i) => trail.x[trail.at(i)]), [0, 1, 2]);
});

test("what was done at once is undone at once, however much that was", async () => {
  const one = bench();
  const together = {};
  one.set(1);
  for (let i = 2; i <= 300; i++) one.set(i, { together });
  await one.history.undo();
  assert.equal(one.value, 1);
  for (let i = 2; i <= 60; i++) one.set(i);
  for (let i = 0; i < 60; i++) await one.history.undo();
  assert.equal(one.value, 10);
});

test("a deletion that waits is tried until the service can be reached", async (t) => {
  t.mock.timers.enable({ apis: ["setTimeout"] });
  const answers = [() => Promise.reject(new TypeError("no network")), async () => ({ ok: true, headers: new Headers() })];
  const sent = [];
  Object.assign(globalThis, {
    document: { baseURI: "http://site/" }, sessionStorage: { getItem: () => null },
    fetch: (url, { method, headers }) => (sent.push(`${method} ${url.pathname} ${headers["if-match"]}`), answers.shift()()),
  });
  const { Changes } = await import("../../../service/dropanchor_service/dashboard/data/changes.js");
  const changes = new Changes();
  const settled = () => new Promise((resolve) => setImmediate(resolve));
  changes.removeLater("Destination mail deleted.", "destinations/mail", "e1", "");
  t.mock.timers.tick(20_000);
  await settled();
  assert.deepEqual([sent.length, changes.isLeaving("destinations/mail")], [1, true]);
  t.mock.timers.tick(3000);
  await settled();
  assert.deepEqual(sent, Array(2).fill("DELETE /api/v1/destinations/mail e1"));
  assert.equal(changes.isLeaving("destinations/mail"), false);
});

test("an anchor that arrow keys have moved stays where it is until that is saved", async () => {
  const { AnchorEditor } = await import("../../../service/dropanchor_service/dashboard/setup/anchors.js");
  const saved = [];
  const changes = { read: async () => ({ value: {}, etag: "e" }), edit: async (_what, path, { x }) => (saved.push([path, x]), true) };
  const editor = new AnchorEditor({ setAnchors() {}, redraw() {}, view: { x: 0, y: 0 } }, changes);
  editor.setAnchors([{ id: "a", x: 1, y: 2, z: 0 }]);
  editor.open();
  editor.select("a");
  editor.key({ key: "ArrowRight", shiftKey: false });
  editor.drop();
  assert.deepEqual([saved, editor.isUnsaved, editor.origin.x], [[], true, 1]);
  await editor.save();
  assert.deepEqual([saved, editor.isUnsaved, editor.origin], [[["anchors/a", 1.1]], false, null]);
});
