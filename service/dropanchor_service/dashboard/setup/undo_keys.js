/** Ctrl+Z undoes what was done on the page, whatever has the focus, and Ctrl+Shift+Z does it again. */

const TEXT = "input:not([type=checkbox], [type=radio], [type=range], [type=color], [type=file]), textarea";

/** A text field keeps these keys while it has typing of its own to undo, which is until something is saved.
 * @param {import("../data/changes.js").Changes} changes */
export function installUndoKeys(changes) {
  /** @type {WeakSet<EventTarget>} */
  let typed = new WeakSet();
  document.addEventListener("input", ({ target }) => target && typed.add(target), { capture: true });
  changes.addEventListener("done", () => (typed = new WeakSet()));
  document.addEventListener("keydown", (event) => {
    const { target, key, shiftKey, ctrlKey, metaKey, altKey } = event;
    const isRedo = key === "y" || (shiftKey && key.toLowerCase() === "z");
    if (!(ctrlKey || (metaKey && key !== "y")) || altKey || !(isRedo || key.toLowerCase() === "z")) return;
    if (target instanceof Element && target.matches(TEXT) && typed.has(target)) return;
    if (changes.history.isEmpty || document.querySelector("dialog[open]")) return;
    event.preventDefault();
    if (isRedo) changes.history.redo();
    else changes.history.undo();
  });
}
