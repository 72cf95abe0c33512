import assert from "node:assert/strict";
import { test } from "node:test";

test("what asks for one value does not make a link that was just followed the address that the page shows", async () => {
  globalThis.location = /** @type {any} */ ({ search: "", hash: "#tag=first", pathname: "/" });
  const { addressValues, isAddressRead, readAddress } = await import("../../../service/dropanchor_service/dashboard/data/address.js");
  assert.ok(isAddressRead());
  location.hash = "#tag=second"; // the page has not heard of it yet
  assert.equal(addressValues().get("tag"), "second");
  assert.ok(!isAddressRead());
  assert.equal(readAddress().get("tag"), "second");
  assert.ok(isAddressRead());
});
