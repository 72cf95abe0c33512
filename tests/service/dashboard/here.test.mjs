import assert from "node:assert/strict";
import { test } from "node:test";

import { Choice } from "../../../service/dropanchor_service/dashboard/page/choice.js";
import { Here } from "../../../service/dropanchor_service/dashboard/page/here.js";

const LABELS = ["here.details", "tag.follow", "here.select_also", "here.past", "here.settings"];

test("the menu does nothing to a tag before a person agrees to lose what is typed for another", () => {
  const choice = new Choice();
  choice.select("typed");
  const did = [];
  let agree = () => {};
  const select = (tag, then = () => {}) => (agree = () => (choice.select(tag), then()));
  let items = [];
  new Here({
    choice, select,
    fleet: { names: ["other"], labels: ["other"] },
    menu: { open: (_left, _top, _title, shown) => (items = shown) },
    setup: { changes: { mayWrite: true }, tagPanel: { openSettings: () => did.push("settings") } },
    past: { active: false, enter: () => did.push("past") },
    panels: { open: (name, show) => (did.push(`open ${name}`), show()) },
  }).open({ x: NaN, y: NaN, left: 0, top: 0 }, 0);
  const press = (label) => items[LABELS.indexOf(label)].act();

  press("tag.follow");
  assert.equal(choice.follow, false);
  press("here.past");
  press("here.settings");
  assert.deepEqual([choice.selected, did], ["typed", []]);
  agree();
  assert.deepEqual([choice.selected, did], ["other", ["settings"]]);
  press("tag.follow");
  agree();
  assert.equal(choice.follow, true);
  press("here.past");
  agree();
  assert.deepEqual(did, ["settings", "open past", "past"]);
});
