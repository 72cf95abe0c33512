/** Messages about the page itself: connecting, starting, connection lost, key required, no tags yet. */

import { hasKey, storeKey } from "../data/access.js";
import { age } from "../data/format.js";
import { t } from "../i18n/language.js";
import { shareToken } from "../data/shared.js";
import { SharedNotice } from "./shared_notice.js";
import { byId, instead, write } from "../page/parts.js";

export class Notices {
  #shared = new SharedNotice();
  /** What is shown while there are no tags. @type {import("./first_hour.js").FirstHour | null} */
  firstHour = null;
  /** Return how many alarms want somebody. */
  alarms = () => 0;

  /** @param {import("../data/connection.js").Connection} connection @param {import("../data/fleet.js").Fleet} fleet */
  constructor(connection, fleet) {
    this.connection = connection;
    this.fleet = fleet;
    byId("retry").addEventListener("click", () => connection.retry());
    for (const button of document.querySelectorAll("button[data-copies]")) installCopy(button);
    connection.addEventListener("status", () => this.update());
    instead(byId("locked"), "submit", () => this.#unlock());
    this.update();
  }

  update() {
    const { status, lostAt, progress } = this.connection;
    const isPast = this.fleet.past;
    byId("status").dataset.status = isPast ? "past" : status;
    write(byId("status-text"), t(isPast ? "status.past" : `status.${status}`));
    byId("lost").hidden = status !== "lost" || isPast;
    const [title, alarms] = [isPast ? t("page.past_title") : status === "lost" ? t("page.lost_title") : "Dropanchor", this.alarms()];
    document.title = alarms > 0 ? t("alarms.page_title", { n: alarms, title }) : title;
    write(byId("lost-text"), t("lost.text", { age: age((performance.now() - lostAt) / 1000) }));
    byId("starting").hidden = status !== "starting";
    write(byId("progress"), progress);
    byId("locked").hidden = status !== "locked" || shareToken !== null;
    this.#shared.update(status === "locked");
    byId("refused").hidden = !hasKey();
    const isEmpty = !isPast && status === "live" && this.connection.stats.frames > 0 && this.fleet.size === 0;
    const isNew = isEmpty && byId("empty").hidden;
    byId("empty").hidden = !isEmpty;
    if (isNew) this.firstHour?.show();
    this.firstHour?.update();
  }

  #unlock() {
    const field = /** @type {HTMLInputElement} */ (byId("key"));
    storeKey(field.value.trim());
    field.value = "";
    this.connection.retry();
  }
}

/** @param {Element} button */
function installCopy(button) {
  button.addEventListener("click", async () => {
    const source = byId(/** @type {HTMLElement} */ (button).dataset.copies ?? "");
    const field = source instanceof HTMLInputElement ? source : null;
    try {
      await navigator.clipboard.writeText(field?.value ?? source.textContent ?? "");
      button.textContent = t("copy.copied");
    } catch { // without HTTPS there is no clipboard, but a selection can be copied
      if (field) field.select();
      else getSelection()?.selectAllChildren(source);
      button.textContent = t(document.execCommand("copy") ? "copy.copied" : "copy.press");
    }
    setTimeout(() => (button.textContent = t("copy.copy")), 1600);
  });
}
