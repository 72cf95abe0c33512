/** Find elements of the document, and write into them only what differs. */

/** @template {HTMLElement} T @param {string} id @returns {T} */
export const byId = (id) => /** @type {T} */ (document.getElementById(id));

/** @param {ParentNode} box @param {string} name */
export const partOf = (box, name) => /** @type {HTMLElement} */ (box.querySelector(`[data-part="${name}"]`));

/** @param {HTMLFormElement} form @param {string} name */
export const fieldOf = (form, name) => /** @type {HTMLInputElement} */ (form.elements.namedItem(name));

/** Return the number in a field; null when it is empty. @param {HTMLInputElement} input */
export const numberOf = (input) => (Number.isNaN(input.valueAsNumber) ? null : input.valueAsNumber);

/** Do this instead of what a browser does with a form. @param {HTMLElement} form @param {"submit" | "reset"} what
 * @param {(event: Event) => unknown} act */
export const instead = (form, what, act) => form.addEventListener(what, (event) => {
  event.preventDefault();
  act(event);
});

/** @param {Element} element @param {string} text */
export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Write a text, and hide the element while there is none. @param {HTMLElement} element @param {string} text */
export function writeOrHide(element, text) {
  write(element, text);
  element.hidden = text === "";
}
