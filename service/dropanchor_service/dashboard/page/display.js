/** The dialog in which a person chooses the language and the units. A choice is remembered, stands in the address and loads the page anew. */

import { writeAddress } from "../data/address.js";
import { chosen, remember } from "../data/display.js";
import { UNITS, unitNames } from "../data/units.js";
import { listLanguages } from "../i18n/document.js";
import { language } from "../i18n/language.js";

/** Write the choices that this browser remembers into the address, so that a copied link keeps them. */
export function showChoices() {
  writeAddress({
    lang: chosen("lang", [language]), length: chosen("length", [unitNames.length]), velocity: chosen("velocity", [unitNames.velocity]),
  });
}

/** Offer the languages in a list. @param {HTMLSelectElement} list */
export function installLanguages(list) {
  listLanguages(list);
  list.addEventListener("change", () => choose("lang", list.value));
}

/** Offer the units of a kind in a list. @param {HTMLSelectElement} list @param {keyof typeof UNITS} kind */
export function installUnitChoice(list, kind) {
  list.replaceChildren(...Object.entries(UNITS[kind]).map(([name, { symbol }]) => new Option(symbol, name, false, name === unitNames[kind])));
  list.addEventListener("change", () => choose(kind, list.value));
}

/** @param {string} name @param {string} value */
function choose(name, value) {
  remember({ [name]: value });
  writeAddress({ [name]: value });
  location.reload();
}

/** Open a dialog with a button, and close it with the button inside it. @param {HTMLElement} button @param {HTMLDialogElement} dialog
 * @param {import("./one_panel.js").Panels} panels @param {import("./one_panel.js").PanelName} name @param {() => void} [show] */
export function installDialog(button, dialog, panels, name, show = () => dialog.showModal()) {
  panels.addDialog(name, dialog);
  button.addEventListener("click", () => panels.open(name, show));
  dialog.querySelector('[data-part="close"]')?.addEventListener("click", () => dialog.close());
}
