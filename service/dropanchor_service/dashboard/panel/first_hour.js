/** The page without tags: four steps to the first picture, those done with a tick, and what helps with each. */

import { send } from "../data/access.js";
import { api } from "../data/connection.js";
import { drawCode, forOthers, readConnect } from "../data/page_address.js";
import { t } from "../i18n/language.js";
import { byId, partOf, write, writeOrHide } from "../page/parts.js";

const SIMULATED = 6;

export class FirstHour {
  /** Return which steps are done. @type {() => Record<string, boolean>} */
  done = () => ({});
  #maySimulate = false;

  /** @param {HTMLElement} box @param {import("../data/changes.js").Changes} changes */
  constructor(box, changes) {
    this.box = box;
    this.changes = changes;
    for (const button of /** @type {NodeListOf<HTMLElement>} */ (box.querySelectorAll("button[data-opens]"))) {
      button.addEventListener("click", () => openPart(button.dataset.opens ?? ""));
    }
    const anchor = /** @type {HTMLAnchorElement} */ (partOf(box, "phone-link"));
    write(anchor, anchor.href); // until the service has said how others reach it
    partOf(box, "simulate").addEventListener("click", () => changes.attempt(() => this.#simulate()));
  }

  update() {
    if (this.box.hidden) return;
    const done = this.done();
    for (const step of /** @type {NodeListOf<HTMLElement>} */ (this.box.querySelectorAll("li[data-step]"))) {
      const isDone = done[step.dataset.step ?? ""] ?? false;
      step.dataset.done = String(isDone);
      write(partOf(step, "tick"), isDone ? "✓" : "○");
      partOf(step, "tick").setAttribute("aria-label", t(isDone ? "first.done" : "first.open"));
    }
    partOf(this.box, "by-itself").hidden = !(this.#maySimulate && this.changes.mayWrite);
    partOf(this.box, "by-command").hidden = !partOf(this.box, "by-itself").hidden;
    for (const button of /** @type {NodeListOf<HTMLElement>} */ (this.box.querySelectorAll("button[data-opens]"))) {
      button.hidden = byId(button.dataset.opens ?? "").hidden;
    }
  }

  /** Show how a tag or a phone connects, since the service knows where. */
  async show() {
    try {
      const { simulate, credentials, pages, may_simulate } = await readConnect();
      write(byId("command"), simulate);
      byId("credentials").hidden = !credentials;
      this.#maySimulate = may_simulate;
      await this.#showPhone(forOthers("tag/", pages));
    } catch {
      // The connection reports the failure. This is requested again after it is back.
    }
  }

  /** @param {string | null} link */
  async #showPhone(link) {
    const anchor = /** @type {HTMLAnchorElement} */ (partOf(this.box, "phone-link"));
    anchor.href = link ?? "tag/";
    write(anchor, anchor.href);
    writeOrHide(partOf(this.box, "phone-note"), link === null ? t("first.loopback") : link.startsWith("https:") ? "" : t("first.phone_https"));
    const code = /** @type {HTMLImageElement} */ (partOf(this.box, "phone-code"));
    code.hidden = true;
    if (link !== null && this.changes.mayWrite) await drawCode(code, link);
  }

  /** Start simulated tags. To undo that stops them. */
  async #simulate() {
    const start = async () => {
      await send(api("simulated-tags"), "PUT", { tags: SIMULATED });
      return stop;
    };
    const stop = async () => {
      await send(api("simulated-tags"), "DELETE", null);
      return start;
    };
    this.changes.history.push({ what: t("first.simulated", { n: SIMULATED }), back: await start() });
  }
}

/** Open the part of the page that a button or a summary with this id opens. @param {string} id */
function openPart(id) {
  const part = byId(id);
  if (part instanceof HTMLDetailsElement) part.open = true;
  else part.click();
}
