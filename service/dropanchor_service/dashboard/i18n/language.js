/** The language of the page: its messages, numbers and times. A page in another language is loaded anew. */

import { chosen } from "../data/display.js";
import { timeZone } from "../data/time_zone.js";

/** @typedef {string | {one: string, other: string}} Message `{name}` stands for a value; `one` is for n = 1 */
/** @typedef {Record<string, string | number | undefined>} Values */

/** The names of the languages in themselves. */
export const LANGUAGES = /** @type {const} */ ({ en: "English", de: "Deutsch" });
const CODES = /** @type {(keyof typeof LANGUAGES)[]} */ (Object.keys(LANGUAGES));
/** With times of 24 hours and the day before the month, unless the browser asks for another region. */
const REGIONS = { en: "en-GB", de: "de-DE" };

const wanted = globalThis.window ? navigator.languages : [];

export const language = chosen("lang", CODES) ?? CODES.find((code) => code === wanted.map(baseOf).find(isKnown)) ?? "en";
export const locale = wanted.find((tag) => baseOf(tag) === language && tag !== language) ?? REGIONS[language];

/** @type {{default: Record<string, Message>}} */
const { default: messages } = await import(new URL(`./${language}/messages.js`, import.meta.url).href);
const plurals = new Intl.PluralRules(locale);
/** @type {Map<number, Intl.NumberFormat>} */
const formats = new Map();
const grouped = new Intl.NumberFormat(locale);

/** Return whether the catalogue has a message. @param {string} key */
export const has = (key) => key in messages;

/** Return how the keys with this beginning go on, in the order of the catalogue. @param {string} beginning */
export const keysAfter = (beginning) => Object.keys(messages).filter((key) => key.startsWith(beginning)).map((key) => key.slice(beginning.length));

/** Return a message with its values. Numbers among them are written for the language. @param {string} key @param {Values} [values] */
export function t(key, values = {}) {
  const message = messages[key];
  if (message === undefined) throw new Error(`no message ${key} in ${language}`);
  const text = typeof message === "string" ? message : message[plurals.select(Number(values.n)) === "one" ? "one" : "other"];
  return text.replace(/\{(\w+)\}/g, (whole, name) => {
    const value = values[name];
    return typeof value === "number" ? count(value) : String(value ?? whole);
  });
}

/** Format a whole number with groups of thousands. @param {number} value */
export const count = (value) => grouped.format(value);

/** Format a number without groups. @param {number} value @param {number} least decimals @param {number} [most] decimals */
export function decimal(value, least, most = least) {
  const key = 32 * least + most;
  let format = formats.get(key);
  if (!format) {
    format = new Intl.NumberFormat(locale, { minimumFractionDigits: least, maximumFractionDigits: most, useGrouping: false });
    formats.set(key, format);
  }
  return format.format(value);
}

/** Format a time. The clock has 24 hours. @param {number | Date} time @param {Intl.DateTimeFormatOptions} options */
export const timeText = (time, options) => new Intl.DateTimeFormat(locale, { timeZone: timeZone(), ...options, hourCycle: "h23" }).format(time);

/** @param {string} tag such as de-AT */
function baseOf(tag) {
  return tag.split("-")[0].toLowerCase();
}

/** @param {string} code */
function isKnown(code) {
  return /** @type {string[]} */ (CODES).includes(code);
}
