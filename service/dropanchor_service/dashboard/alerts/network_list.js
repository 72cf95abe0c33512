/** The networks inside whose machines may receive events: listed, allowed, and offered where one is missing. */

import { t } from "../i18n/language.js";
import { refusalInForm } from "../i18n/said.js";
import { keepLines } from "./lines.js";
import { button, element } from "../page/elements.js";
import { instead, partOf, writeOrHide } from "../page/parts.js";

export class NetworkList {
  /** @param {HTMLElement} box @param {import("./alert_store.js").AlertStore} store */
  constructor(box, store) {
    this.box = box;
    this.store = store;
    this.form = /** @type {HTMLFormElement} */ (partOf(box, "allow-form"));
    instead(this.form, "submit", async () => {
      const field = /** @type {HTMLInputElement} */ (this.form.elements.namedItem("network"));
      if (await this.#attempt(field.value, "PUT")) field.value = "";
    });
  }

  update() {
    const { networks, isAdmin } = this.store;
    this.box.hidden = networks.length === 0 && !isAdmin;
    this.form.hidden = !isAdmin;
    keepLines(partOf(this.box, "list"), networks.map((one) => ({ key: JSON.stringify([one, isAdmin]), make: () => this.#line(one) })));
  }

  /** Offer the network that a destination lacks, where it is refused.
   * @param {HTMLFormElement} form @param {import("./item_editor.js").ItemEditor} editor */
  offerIn(form, editor) {
    const allow = /** @type {HTMLButtonElement} */ (partOf(form, "allow"));
    editor.addEventListener("change", () => {
      partOf(form, "mend").hidden = editor.network === null || !this.store.isAdmin;
      allow.textContent = t("networks.allow_one", { network: editor.network ?? "" });
    });
    allow.addEventListener("click", async () => {
      const problem = await this.#refusalOf(/** @type {string} */ (editor.network), "PUT");
      if (problem === "") form.requestSubmit();
      else partOf(form, "problem").textContent = problem;
    });
  }

  /** @param {{network: string, in_settings: boolean}} one */
  #line({ network, in_settings }) {
    const line = element("li", "");
    line.append(element("strong", network));
    if (in_settings) line.append(element("span", t("networks.in_settings")));
    else if (this.store.isAdmin) line.append(button(t("networks.remove"), t("networks.remove_one", { network }), () => this.#attempt(network, "DELETE")));
    return line;
  }

  /** Return whether the service did it; if not, say why. @param {string} network @param {"PUT" | "DELETE"} method */
  async #attempt(network, method) {
    const problem = await this.#refusalOf(network, method);
    writeOrHide(partOf(this.form, "problem"), problem);
    return problem === "";
  }

  /** @param {string} network @param {"PUT" | "DELETE"} method */
  async #refusalOf(network, method) {
    try {
      await this.store.setNetwork(network, method);
      return "";
    } catch (error) {
      return refusalInForm(error);
    }
  }
}
