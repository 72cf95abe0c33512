import assert from "node:assert/strict";
import { test } from "node:test";

import { Panels, PLACES } from "../../../service/dropanchor_service/dashboard/page/one_panel.js";

const NAMES = Object.keys(PLACES);
const sharePlace = (a, b) => PLACES[a].some((place) => PLACES[b].includes(place));

/** Return every panel, none of them open. `answer` is what a person says when something typed would be lost. */
function everyPanel(answer = true) {
  const asked = [];
  const panels = new Panels(async () => (asked.push(true), answer));
  const open = new Set();
  const typed = new Set();
  for (const name of NAMES) panels.add(name, { isOpen: () => open.has(name), isUnsaved: () => typed.has(name), leave: () => open.delete(name) && typed.delete(name) });
  const show = (name) => panels.open(name, () => open.add(name));
  return { panels, open, typed, asked, show };
}

const pairs = NAMES.flatMap((first) => NAMES.map((second) => [first, second]));

test("every panel opens from every other at once, and leaves it only if both need one place", () => {
  for (const [first, second] of pairs) {
    const { open, asked, show } = everyPanel();
    show(first);
    show(second);
    const both = first === second || !sharePlace(first, second);
    assert.deepEqual([...open], both ? [...new Set([first, second])] : [second], `${first}, ${second}`);
    assert.deepEqual(asked, [], `${first}, ${second}`);
  }
});

test("something typed is lost only with consent, whatever is opened", async () => {
  for (const [first, second] of pairs) {
    for (const answer of [true, false]) {
      const { open, typed, asked, show } = everyPanel(answer);
      show(first);
      typed.add(first);
      let shown = false;
      show(second);
      await null;
      await null;
      shown = open.has(second);
      const atRisk = first === second || sharePlace(first, second);
      assert.equal(asked.length, Number(atRisk), `${first}, ${second}`);
      assert.equal(open.has(first) && typed.has(first), !atRisk || !answer || first === second, `${first}, ${second}`);
      assert.equal(shown, !atRisk || answer || first === second, `${first}, ${second}`);
    }
  }
});

test("a button that opens a panel closes it again, and asks if something typed would be lost", async () => {
  const { panels, open, typed, asked, show } = everyPanel(false);
  for (const name of NAMES) {
    panels.toggle(name, () => open.add(name));
    assert.deepEqual([...open], [name]);
    panels.toggle(name, () => assert.fail("it is open"));
    assert.deepEqual([...open], []);
  }
  assert.deepEqual(asked, []);
  show("rule");
  typed.add("rule");
  panels.close("rule");
  await null;
  assert.deepEqual([asked.length, ...open], [1, "rule"]);
});

test("a list leaves the form that is in the lists, and nothing else", () => {
  for (const name of NAMES) {
    const { panels, open, show } = everyPanel();
    show(name);
    let listed = false;
    panels.free("lists", () => (listed = true));
    assert.ok(listed);
    assert.equal(open.has(name), !PLACES[name].includes("lists"), name);
  }
});

test("a panel that closes with the focus in it gives the focus back", (t) => {
  const place = (name) => ({ name, rects: [1], getClientRects() { return this.rects; }, focus() { document.activeElement = this; } });
  const [button, inside, elsewhere] = ["button", "inside", "elsewhere"].map(place);
  globalThis.document = { activeElement: button };
  t.after(() => delete globalThis.document);
  const panels = new Panels(async () => true);
  let isOpen = false;
  panels.add("plans", { isOpen: () => isOpen, leave: () => ([isOpen, inside.rects] = [false, []]) });
  for (const [last, then] of [[inside, button], [elsewhere, elsewhere]]) {
    document.activeElement = button;
    panels.open("plans", () => ([isOpen, inside.rects] = [true, [1]]));
    document.activeElement = last;
    panels.open("plans", () => {}); // something else in it
    panels.close("plans");
    assert.equal(document.activeElement.name, then.name);
  }
});

test("what is being saved is waited for, and nobody is asked about it", async () => {
  for (const [first, second] of pairs.filter(([one, other]) => one !== other && sharePlace(one, other))) {
    for (const isRefused of [false, true]) {
      const { panels, open, typed, asked, show } = everyPanel(false);
      let finish = () => {};
      let saving = new Promise((resolve, reject) => (finish = isRefused ? reject : resolve));
      panels.add(first, { isOpen: () => open.has(first), isUnsaved: () => typed.has(first), saving: () => saving, leave: () => open.delete(first) });
      open.add(first);
      typed.add(first);
      show(second);
      assert.deepEqual([...open], [first], `${first}, ${second}`);
      saving = null;
      if (!isRefused) typed.delete(first);
      finish();
      await new Promise(setImmediate);
      assert.equal(asked.length, Number(isRefused), `${first}, ${second}`);
      assert.deepEqual([...open], [isRefused ? first : second], `${first}, ${second}`);
    }
  }
});
