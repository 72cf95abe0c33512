/** Make elements: texts, buttons and lines of lists. */

/** @param {string} name @param {string} text @param {string} [className] */
export const element = (name, text, className = "") => Object.assign(document.createElement(name), { textContent: text, className });

/** @param {string} text @param {string | null} label for people who cannot see what it is about; null: the text says it
 * @param {() => void} act @param {string} [className] */
export function button(text, label, act, className = "text") {
  const made = /** @type {HTMLButtonElement} */ (element("button", text, className));
  made.type = "button";
  if (label !== null) made.setAttribute("aria-label", label);
  made.addEventListener("click", act);
  return made;
}

/** @param {(string | Node)[]} parts */
export function line(...parts) {
  const made = document.createElement("li");
  made.append(...parts);
  return made;
}
