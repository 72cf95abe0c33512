// The connection of the page to the service, with answers that come late or in another order.
import assert from "node:assert/strict";
import { test } from "node:test";

/** @type {{path: string, answer: (status: number, value?: unknown) => void}[]} */
const asked = [];
Object.assign(globalThis, {
  document: { baseURI: "http://site/" }, sessionStorage: { getItem: () => null }, setTimeout: () => 0,
  fetch: (/** @type {URL} */ { pathname }) => new Promise((resolve) => asked.push({
    path: pathname,
    answer: (status, value) => resolve(new Response(value === undefined ? new ReadableStream() : JSON.stringify(value), { status })),
  })),
});
const { Connection } = await import("../../../service/dropanchor_service/dashboard/data/connection.js");

/** Return the next request, which ends with this. @param {string} end */
const next = (end) => {
  const at = asked.findIndex(({ path }) => path.endsWith(end));
  return asked.splice(at, 1)[0];
};

const settled = () => new Promise((resolve) => setImmediate(resolve));

/** Return a connection that is live, the sites that it tells, and its first request for one. */
async function live() {
  const connection = new Connection();
  /** @type {unknown[]} */
  const sites = [];
  connection.addEventListener("site", (event) => sites.push(/** @type {CustomEvent} */ (event).detail));
  connection.start();
  const first = next("/site");
  next("/stream").answer(401);
  await settled();
  assert.equal(connection.status, "locked");
  connection.retry(); // with a key
  next("/stream").answer(200);
  await settled();
  assert.equal(connection.status, "live");
  return { connection, sites, first };
}

test("a request that was sent without a key does not lock a page that has one", async () => {
  const { connection, first } = await live();
  first.answer(401);
  await settled();
  assert.equal(connection.status, "live");
});

test("a site that arrives after a newer one is dropped", async () => {
  const { connection, sites, first } = await live();
  connection.refresh();
  next("/site").answer(200, { name: "newer" });
  await settled();
  first.answer(200, { name: "older" });
  await settled();
  assert.deepEqual(sites, [{ name: "newer" }]);
});
