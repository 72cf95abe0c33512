/** The keys of the whole page, and the dialog (`?`) that lists all keys. */

import { withUnits } from "../data/format.js";
import { t } from "../i18n/language.js";

/** The keys, with the messages that name those without a sign of their own, and what they do. @type {[string[], string][]} */
const KEYS = [
  [["?"], "keys.help"], [["/"], "keys.filter"], [["A"], "keys.alarm"], [["Esc"], "keys.escape"],
  [["← ↑ → ↓"], "keys.move"], [["+", "−"], "keys.zoom"], [["0"], "keys.fit"], [["Enter"], "keys.measure"],
  [["↑ ↓", "Enter"], "keys.table"], [["keys.ctrl_space", "keys.shift_down"], "keys.several"], [["keys.menu"], "keys.here"], [["keys.space"], "keys.play"],
  [["keys.ctrl_z"], "keys.undo"], [["keys.ctrl_shift_z"], "keys.redo"],
  [["keys.shift_arrows"], "keys.anchor"], [["keys.delete"], "keys.corner"],
];

/** Return whether a key goes into a field. @param {KeyboardEvent} event */
export const isTyping = ({ target }) => target instanceof Element && target.matches("input:not([type=checkbox], [type=range]), select, textarea");

/** @param {HTMLDialogElement} dialog @param {HTMLElement} filter field that `/` goes to @param {() => void} help */
export function installKeyboard(dialog, filter, help) {
  const list = /** @type {HTMLElement} */ (dialog.querySelector("dl"));
  list.append(...KEYS.map(([keys, message]) => line(keys, withUnits(t(message)))));
  document.addEventListener("keydown", (event) => {
    if (isTyping(event) || event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
    if (event.key === "?") help();
    else if (event.key === "/") filter.focus();
    else return;
    event.preventDefault();
  });
}

/** @param {string[]} keys @param {string} meaning */
function line(keys, meaning) {
  const pair = document.createElement("div");
  const term = document.createElement("dt");
  for (const key of keys) term.append(Object.assign(document.createElement("kbd"), { textContent: key.startsWith("keys.") ? t(key) : key }));
  pair.append(term, Object.assign(document.createElement("dd"), { textContent: meaning }));
  return pair;
}
