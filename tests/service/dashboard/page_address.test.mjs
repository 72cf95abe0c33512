import assert from "node:assert/strict";
import { test } from "node:test";

import { forOthers } from "../../../service/dropanchor_service/dashboard/data/page_address.js";

test("a phone gets the address of the network where the page is open on the service's own machine", () => {
  const at = (/** @type {string} */ base, /** @type {string[]} */ ...pages) => {
    globalThis.document = /** @type {any} */ ({ baseURI: base });
    return forOthers("tag/", pages);
  };
  const network = "http://192.0.2.7:8080/";
  for (const own of ["http://127.0.0.1:8080/", "http://localhost:8080/", "http://[::1]:8080/", "http://127.0.1.1:8080/?lang=de"]) {
    assert.equal(at(own, network), "http://192.0.2.7:8080/tag/");
    assert.equal(at(own), null); // it listens there alone
  }
  assert.equal(at("https://yard.example/positions/", network), "https://yard.example/positions/tag/");
});
