/** The secret of a webhook: made here, shown until it is saved, and copied with one click. */

import { t } from "../i18n/language.js";

const PREFIX = "whsec_";
const BYTES = 32;

/** Return a random secret. */
export const newSecret = () => PREFIX + btoa(String.fromCharCode(...crypto.getRandomValues(new Uint8Array(BYTES))));

export class SecretField {
  /** @param {HTMLFormElement} form @param {import("./item_editor.js").ItemEditor} editor */
  constructor(form, editor) {
    const part = (/** @type {string} */ name) => /** @type {HTMLElement} */ (form.querySelector(`[data-part="${name}"]`));
    this.field = /** @type {HTMLInputElement} */ (form.elements.namedItem("secret"));
    this.copy = part("copy-secret");
    this.what = part("secret-what");
    this.editor = editor;
    part("new-secret").addEventListener("click", () => {
      this.field.value = newSecret();
      this.#update();
    });
    this.field.addEventListener("input", () => this.#update());
    editor.addEventListener("change", () => this.#update());
  }

  /** A new webhook needs a secret; one that is empty keeps that of a known webhook, which nobody reads again. */
  #update() {
    const { isNew } = this.editor;
    const isEmpty = this.field.value === "";
    this.field.required = isNew;
    this.field.placeholder = isNew ? `${PREFIX}…` : t("destination.secret_placeholder");
    this.copy.hidden = isEmpty;
    this.what.textContent = t(isEmpty && !isNew ? "destination.secret_kept" : "destination.secret_once");
  }
}
