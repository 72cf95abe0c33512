/** Lines of a list that are made again only when they change, so that a button keeps the focus. */

/** @typedef {{key: string, make: () => HTMLElement}} Line */

/** Show these lines. A line with the same key stays; a new one takes over the focus of the one in its place.
 * @param {HTMLElement} list @param {readonly Line[]} lines */
export function keepLines(list, lines) {
  lines.forEach(({ key, make }, i) => {
    const present = /** @type {HTMLElement | undefined} */ (list.children[i]);
    if (present?.dataset.key === key) return;
    const label = present?.contains(document.activeElement) ? document.activeElement?.getAttribute("aria-label") : null;
    const line = make();
    line.dataset.key = key;
    if (present) present.replaceWith(line);
    else list.append(line);
    if (label) [...line.querySelectorAll("button")].find((one) => one.getAttribute("aria-label") === label)?.focus();
  });
  while (list.children.length > lines.length) list.lastElementChild?.remove();
}
