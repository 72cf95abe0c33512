/** Create, list and revoke share links, for those who may. */

import { send } from "../data/access.js";
import { addressValues } from "../data/address.js";
import { api, getJson } from "../data/connection.js";
import { t, timeText } from "../i18n/language.js";
import { refusal } from "../i18n/said.js";
import { revocableLine } from "./revocable_line.js";
import { instead, partOf, writeOrHide } from "./parts.js";

/** @typedef {{id: string, name: string, expires_ns: number, tag: string | null, group: string | null}} Share */

export class SharePanel {
  /** @param {HTMLElement} box @param {import("./choice.js").Choice} choice */
  constructor(box, choice) {
    this.box = box;
    this.choice = choice;
    this.form = /** @type {HTMLFormElement} */ (box.querySelector("form"));
    instead(this.form, "submit", () => this.#attempt(() => this.#create()));
  }

  /** Show the links, and offer what the page shows now. Without the right to share, or anything to protect, show nothing. */
  async open() {
    partOf(this.box, "created").hidden = true;
    writeOrHide(partOf(this.box, "problem"), "");
    this.#offer();
    await this.#refresh();
  }

  async #refresh() {
    const { available, shares } = await getJson(api("shares")).catch(() => ({ available: false, shares: [] }));
    this.box.hidden = !available;
    this.#list(shares);
  }

  #offer() {
    const { selected, group } = this.choice;
    const reach = /** @type {HTMLSelectElement} */ (this.form.elements.namedItem("reach"));
    reach.replaceChildren(
      new Option(t("share.all"), "all"),
      ...(selected === null ? [] : [new Option(t("share.tag", { tag: selected }), "tag")]),
      ...(group === "" ? [] : [new Option(t("share.group", { group }), "group")]),
    );
  }

  async #create() {
    const values = new FormData(this.form);
    const reach = values.get("reach");
    const view = addressValues();
    view.delete("share");
    const body = {
      name: values.get("name"), valid_s: Number(values.get("valid")), view: view.toString(),
      tag: reach === "tag" ? this.choice.selected : null, group: reach === "group" ? this.choice.group : null,
    };
    const { path } = await (await send(api("shares"), "POST", body)).json();
    await this.#refresh();
    partOf(this.box, "link").textContent = new URL(path.replace(/^[^?#]*/, ""), new URL(".", document.baseURI)).href;
    partOf(this.box, "created").hidden = false;
  }

  /** @param {Share[]} shares */
  #list(shares) {
    partOf(this.box, "list").replaceChildren(...shares.map((share) => this.#line(share)));
  }

  /** @param {Share} share */
  #line({ id, name, expires_ns, tag, group }) {
    const time = timeText(expires_ns / 1e6, { dateStyle: "medium", timeStyle: "short" });
    const what = name || tag || group || t("share.all");
    const text = t(expires_ns / 1e6 < Date.now() ? "share.expired" : "share.until", { what, time });
    return revocableLine(text, what, () => this.#attempt(async () => {
      await send(api(`shares/${id}`), "DELETE", null);
      partOf(this.box, "created").hidden = true;
      await this.#refresh();
    }));
  }

  /** @param {() => Promise<void>} act */
  async #attempt(act) {
    let problem = "";
    try {
      await act();
    } catch (error) {
      problem = refusal(error);
    }
    writeOrHide(partOf(this.box, "problem"), problem);
  }
}
