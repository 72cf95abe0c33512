/** Ask before something is deleted. */

/** @param {HTMLDialogElement} dialog @param {string} question @param {string} action what its button says @returns {Promise<boolean>} */
export function confirmed(dialog, question, action) {
  const part = (/** @type {string} */ name) => /** @type {HTMLButtonElement} */ (dialog.querySelector(`[data-part="${name}"]`));
  part("question").textContent = question;
  part("yes").textContent = action;
  dialog.returnValue = "";
  part("yes").onclick = () => dialog.close("yes");
  part("no").onclick = () => dialog.close();
  dialog.showModal();
  return new Promise((resolve) => dialog.addEventListener("close", () => resolve(dialog.returnValue === "yes"), { once: true }));
}
