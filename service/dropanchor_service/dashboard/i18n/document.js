/** Put the messages of the language into a document. Its elements name the messages in `data-i18n…` attributes. */

import { withUnits } from "../data/format.js";
import { installUnits } from "../data/units.js";
import { LANGUAGES, language, t } from "./language.js";

const ATTRIBUTES = { i18nLabel: "aria-label", i18nTitle: "title", i18nPlaceholder: "placeholder", i18nAlt: "alt" };
const NAMES = Object.keys(ATTRIBUTES).map((name) => `[data-${name.replace("i18n", "i18n-").toLowerCase()}]`);

/** Translate everything in the document. @param {Document} page */
export function translate(page) {
  page.documentElement.lang = language;
  installUnits(page);
  for (const element of page.querySelectorAll("[data-i18n]")) fill(element, withUnits(t(/** @type {HTMLElement} */ (element).dataset.i18n ?? "")));
  for (const element of page.querySelectorAll(NAMES.join())) {
    for (const [name, attribute] of Object.entries(ATTRIBUTES)) {
      const key = /** @type {HTMLElement} */ (element).dataset[name];
      if (key !== undefined) element.setAttribute(attribute, t(key));
    }
  }
}

/** List the languages, each in its own name, and choose that of the page. @param {HTMLSelectElement} list */
export function listLanguages(list) {
  list.replaceChildren(...Object.entries(LANGUAGES).map(([code, name]) => new Option(name, code, false, code === language)));
  for (const option of list.options) option.lang = option.value;
}

/** Write a message around the children of an element: `{0}` is the first of them. Children that the message does not
 * name follow it. @param {Element} element @param {string} message */
function fill(element, message) {
  const children = [...element.children];
  /** @type {(string | Element)[]} */
  const parts = message.split(/(\{\d+\})/).filter((part) => part !== "").map((part) => {
    const number = /^\{(\d+)\}$/.exec(part)?.[1];
    return number === undefined ? part : children[Number(number)];
  });
  for (const child of children) if (!parts.includes(child)) parts.push(" ", child);
  element.replaceChildren(...parts);
}
