import assert from "node:assert/strict";
import { test } from "node:test";

test("back closes what is open, but not what a person opens while the page itself goes back", async () => {
  const went = [];
  const location = { href: "http://yard/", hash: "", pathname: "/", search: "" };
  const history = { state: null, back: () => went.push("back"), replaceState: () => {}, pushState: () => went.push("push") };
  /** @type {Record<string, (event: any) => void>} */
  const heard = {};
  Object.assign(globalThis, { location, history, addEventListener: (name, listener) => (heard[name] = listener) });
  const { Back } = await import("../../../service/dropanchor_service/dashboard/page/back.js");
  const states = { zone: true };
  const back = new Back(/** @type {any} */ ({ states, close: (name) => went.push(`close ${name}`) }));
  back.update();
  states.zone = false;
  back.update(); // the browser takes its time
  states.zone = true;
  back.update();
  heard.popstate({ state: { is: "below" } });
  back.update();
  heard.popstate({ state: { is: "below" } }); // a person goes back
  assert.deepEqual(went, ["push", "back", "push", "close zone"]);
});
