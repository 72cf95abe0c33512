import assert from "node:assert/strict";
import { readFileSync, readdirSync } from "node:fs";
import { dirname, join } from "node:path";
import { test } from "node:test";
import { fileURLToPath } from "node:url";

import { decimal, t, timeText } from "../../../service/dropanchor_service/dashboard/i18n/language.js";
import de from "../../../service/dropanchor_service/dashboard/i18n/de/messages.js";
import en from "../../../service/dropanchor_service/dashboard/i18n/en/messages.js";

const PAGE = join(dirname(fileURLToPath(import.meta.url)), "../../../service/dropanchor_service/dashboard");
/** Keys that the page makes of names: of states, units and events, and of words and sentences of the service. */
const MADE = /^(lane|state|status|phone|alerts\.new_|handle|kind|map\.outside|value|destination|event|mail|part|plans\.how|columns|layers|rule|severity|word|say|trail\.(by|from|kind)_|zone\.new_)/;

const sources = readdirSync(PAGE, { recursive: true, encoding: "utf8" })
  .filter((name) => /\.(js|html)$/.test(name) && !name.startsWith(join("i18n", "en")) && !name.startsWith(join("i18n", "de")))
  .map((name) => readFileSync(join(PAGE, name), "utf8"));

/** @param {string | {one: string, other: string}} message */
const placeholders = (message) => [...new Set(JSON.stringify(message).match(/\{\w+\}/g) ?? [])].sort();

test("every message is in both languages, with the same values, but for what the service says in English", () => {
  assert.deepEqual(Object.keys(de).filter((key) => !(key in en) && !/^(say|word|model)\./.test(key)), []);
  for (const [key, message] of Object.entries(en)) {
    assert.notEqual(de[key], "", key);
    assert.equal(typeof de[key], typeof message, key);
    assert.deepEqual(placeholders(de[key]), placeholders(message), key);
  }
});

test("every message that the page names exists, and every message is named", () => {
  const named = new Set(sources.flatMap((text) => [...text.matchAll(/["'`]([a-z_0-9]+(?:\.[a-z_0-9]+)+|close|close_key|cancel|save|delete|delete_asks|ago|place3?)["'`]/g)].map(([, key]) => key)));
  const asked = sources.flatMap((text) => [
    ...[...text.matchAll(/\bt\("([^"]+)"/g)], ...[...text.matchAll(/data-i18n(?:-\w+)?="([^"]+)"/g)],
  ].map(([, key]) => key));
  for (const key of asked) assert.ok(key in en, `no message ${key}`);
  for (const key of Object.keys(en)) assert.ok(named.has(key) || MADE.test(key), `nobody uses ${key}`);
});

test("a message takes its values, and a count its plural", () => {
  assert.equal(t("count.tags", { n: 1 }), "1 tag");
  assert.equal(t("count.tags", { n: 12000 }), "12,000 tags");
  assert.throws(() => t("no.such"), /no message no.such in en/);
});

test("numbers and times are written for the language", () => {
  assert.equal(decimal(1234.5, 2), "1234.50");
  assert.match(timeText(new Date(2027, 0, 15, 23, 5, 9), { dateStyle: "medium", timeStyle: "medium" }), /^15 Jan 2027, 23:05:09$/);
});
