/** Sentences of the service in the language of the page. The service speaks English; a sentence is found by its text. */

import { decimal, language, t } from "./language.js";

const ENGLISH = language === "en" ? {} : { ...(await import("./en/service.js")).default, ...(await import("./en/refusals.js")).default };

/** @type {{key: string, names: string[], pattern: RegExp}[]} */
const sentences = Object.entries(ENGLISH).filter(([key]) => key.startsWith("say.")).map(([key, text]) => ({ key, ...patternOf(text) }));

/** What is wrong with a part of a request: the place, and a sentence about it. */
const PART = /^((?:body|path|query)(?:\.[^:;]+)?): ([^]+)$/;
const NEXT_PART = /; (?=(?:body|path|query)[.:])/;

/** Return a sentence of the service in the language of the page; one without a translation as it is. @param {string} text */
export const said = (text) => translationOf(text) ?? text;

/** Return why the service refused a request, in the language of the page. @param {string} detail */
export function refusal(detail) {
  if (language === "en") return detail;
  return translationOf(detail) ?? partsOf(detail) ?? t("problem.other", { detail });
}

/** Return why the service refused what a form sent, as a sentence without the names of fields in JSON. @param {unknown} error */
export function refusalInForm(error) {
  const text = refusal(error instanceof Error ? error.message : String(error)).replace(/body(\.\w+)+: /g, "");
  return text.charAt(0).toUpperCase() + text.slice(1);
}

/** Return the translation of the sentences about several places; null without one of each. @param {string} detail */
function partsOf(detail) {
  const parts = detail.split(NEXT_PART).map((part) => {
    const [, place, text] = PART.exec(part) ?? [];
    const translation = text === undefined ? null : translationOf(text);
    return translation === null ? null : `${place}: ${translation}`;
  });
  return parts.includes(null) ? null : parts.join("; ");
}

/** @param {string} text @returns {string | null} */
function translationOf(text) {
  for (const { key, names, pattern } of sentences) {
    const found = pattern.exec(text);
    if (!found) continue;
    const translation = t(key, Object.fromEntries(names.map((name, i) => [name, localised(found[i + 1])])));
    return translation.replace(/\.$/, "") + found[names.length + 1];
  }
  return null;
}

/** Return a value of a sentence, which may be a sentence, too. @param {string} value */
const localised = (value) => translationOf(value) ?? (/^\d+\.\d+$/.test(value) ? decimal(Number(value), value.split(".")[1].length) : value);

/** The pattern also has the full stop, which a sentence has only when it stands alone. @param {string} text with `{name}` for values */
function patternOf(text) {
  const names = [...text.matchAll(/\{(\w+)\}/g)].map(([, name]) => name);
  const escaped = text.replace(/\.$/, "").replace(/[.*+?^$()|[\]\\]/g, "\\$&").replace(/\{\w+\}/g, "([^]+?)");
  return { names, pattern: new RegExp(`^${escaped}(\\.?)$`, "i") };
}
