/** What the service says, in the words and the language of the page: found by the code of a sentence, not by its text. */

import { UnreachableError } from "../data/access.js";
import { withUnits } from "../data/format.js";
import { decimal, has, language, t } from "./language.js";

/** @typedef {{code: string, values: Record<string, string>}} Phrase as in the contract */
/** @typedef {{detail: string, detail_phrase?: Phrase | null}} Detail */
/** @typedef {Detail & {type: string, errors?: (Detail & {location: string})[], network?: string}} Problem as in the contract */

const SHOWN_PARTS = 3;

/** Return a sentence of the service in the words of the page; one that the page does not know, as the service says it.
 * @param {string} text @param {Phrase | null} [phrase] */
export const said = (text, phrase) => withUnits(known(text, phrase) ?? text);

/** Return why something failed, in the language of the page. @param {unknown} error */
export function refusal(error) {
  const problem = error instanceof Error && "problem" in error ? /** @type {Problem} */ (error.problem) : null;
  if (error instanceof UnreachableError) return t("problem.unreachable");
  const detail = problem?.detail ?? (error instanceof Error ? error.message : String(error));
  const words = problem && (known(detail, problem.detail_phrase) ?? partsOf(problem));
  return words ?? (language === "en" ? detail : t("problem.other", { detail }));
}

/** Return why the service refused what a form sent, as a sentence without the names of fields in JSON. @param {unknown} error */
export const refusalInForm = (error) => begun(refusal(error).replace(/body(\.\w+)+: /g, ""));

/** Return a text with a capital at its beginning. @param {string} text */
export const begun = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** Return why the service ended a WebSocket. @param {string} reason a sentence, or in the form of a query the code and the values of one */
export function endOf(reason) {
  const { code, ...values } = Object.fromEntries(new URLSearchParams(reason));
  return (code === undefined ? null : messageOf(code, values)) ?? reason;
}

/** Return what is wrong with each part of a request; null unless the page knows a sentence for all. @param {Problem} problem */
function partsOf({ errors = [] }) {
  const parts = errors.slice(0, SHOWN_PARTS).map(({ location, detail, detail_phrase }) => {
    const words = known(detail, detail_phrase);
    return words === null ? null : `${location}: ${words}`;
  });
  return parts.length === 0 || parts.includes(null) ? null : parts.join("; ");
}

/** Return the sentence; null if only the service has words for it, or they are in another language.
 * @param {string} text @param {Phrase | null} [phrase] */
function known(text, phrase) {
  const message = phrase ? messageOf(phrase.code, phrase.values) : null;
  if (message === null) return phrase && language === "en" ? text : null;
  return ended(message, text);
}

/** Return the message of a code with its values; null without one. A value may be a sentence, too: then its code stands
 * at `<name>.code`. @param {string} code @param {Record<string, string>} values @param {string} [within]
 * @returns {string | null} */
function messageOf(code, values, within = "") {
  if (!has(`say.${code}`)) return null;
  const names = Object.keys(values).filter((path) => path.startsWith(within)).map((path) => path.slice(within.length).split(".")[0]);
  return t(`say.${code}`, Object.fromEntries(names.map((name) => [name, valueOf(`${within}${name}`, values)])));
}

/** @param {string} path @param {Record<string, string>} values @returns {string} */
function valueOf(path, values) {
  const code = values[`${path}.code`];
  const text = values[path] ?? "";
  const message = code === undefined ? null : messageOf(code, values, `${path}.`);
  return message === null ? localised(text) : ended(message, text);
}

/** End a message as the text of the service ends: one that stands in another has no full stop. @param {string} message @param {string} text */
const ended = (message, text) => message.replace(/\.$/, "") + (text.endsWith(".") ? "." : "");

/** Return a number as the language writes it, with its decimals. @param {string} value */
const localised = (value) => (/^-?\d+\.\d+$/.test(value) ? decimal(Number(value), value.split(".")[1].length) : value);
