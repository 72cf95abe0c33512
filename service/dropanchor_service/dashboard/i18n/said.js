/** Sentences of the service in the language of the page. The service speaks English; a sentence is found by its text. */

import { decimal, language, t } from "./language.js";

/** @type {{key: string, names: string[], pattern: RegExp}[]} */
const sentences = language === "en" ? [] : Object.entries((await import("./en/service.js")).default)
  .filter(([key]) => key.startsWith("say."))
  .map(([key, text]) => ({ key, ...patternOf(text) }));

/** Return a sentence of the service in the language of the page; one without a translation as it is. @param {string} text */
export const said = (text) => translationOf(text) ?? text;

/** Return why the service refused a request, in the language of the page. @param {string} detail */
export const refusal = (detail) => (language === "en" ? detail : (translationOf(detail) ?? t("problem.other", { detail })));

/** @param {string} text */
function translationOf(text) {
  for (const { key, names, pattern } of sentences) {
    const found = pattern.exec(text);
    if (found) return t(key, Object.fromEntries(names.map((name, i) => [name, localised(found[i + 1])])));
  }
  return null;
}

/** @param {string} value */
const localised = (value) => (/^\d+\.\d+$/.test(value) ? decimal(Number(value), value.split(".")[1].length) : value);

/** @param {string} text with `{name}` for values */
function patternOf(text) {
  const names = [...text.matchAll(/\{(\w+)\}/g)].map(([, name]) => name);
  const escaped = text.replace(/[.*+?^$()|[\]\\]/g, "\\$&").replace(/\{\w+\}/g, "(.+)");
  return { names, pattern: new RegExp(`^${escaped}$`, "i") };
}
