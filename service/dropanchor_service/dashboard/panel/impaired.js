/** Say what of the service needs care, such as a file that was damaged, while its poses go on. */

import { getJson } from "../data/connection.js";
import { shareToken } from "../data/shared.js";
import { t } from "../i18n/language.js";
import { said } from "../i18n/said.js";
import { writeOrHide } from "../page/parts.js";

const PERIOD_MS = 10_000;

const readyUrl = () => new URL("api/v1/health/ready", document.baseURI);

export class Impaired {
  /** @param {HTMLElement} banner */
  constructor(banner) {
    this.banner = banner;
  }

  /** Ask now and every few seconds. Whoever looks at a shared view has no part in this. */
  start() {
    if (shareToken === null) this.#repeat();
  }

  async #repeat() {
    if (!document.hidden) await this.#ask();
    setTimeout(() => this.#repeat(), PERIOD_MS);
  }

  async #ask() {
    try {
      const { impaired, impaired_phrases } = await getJson(readyUrl());
      const text = impaired.length ? t("impaired.text", { what: impaired.map((/** @type {string} */ text, /** @type {number} */ i) => said(text, impaired_phrases[i])).join("; ") }) : "";
      writeOrHide(this.banner, text);
    } catch {
      // It is not ready, or away: the other messages say so.
    }
  }
}
