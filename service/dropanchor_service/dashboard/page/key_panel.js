/** Create, list and revoke keys, for administrators. */

import { send } from "../data/access.js";
import { api, getJson } from "../data/connection.js";
import { drawCode, forOthers, readConnect } from "../data/page_address.js";
import { t, timeText } from "../i18n/language.js";
import { refusalInForm } from "../i18n/said.js";
import { revocableLine } from "./revocable_line.js";
import { fieldOf, instead, partOf, writeOrHide } from "./parts.js";
import { line } from "./elements.js";

/** @typedef {{id: string, name: string, scope: string | null, tag: string | null, expires_ns: number | null}} Key */

export class KeyPanel {
  /** @param {HTMLElement} box */
  constructor(box) {
    this.box = box;
    this.form = /** @type {HTMLFormElement} */ (box.querySelector("form"));
    instead(this.form, "submit", () => this.#attempt(() => this.#create()));
    fieldOf(this.form, "may").addEventListener("change", () => this.#askForTag());
  }

  /** Show the keys. Without the right to see them, or anything to protect, show nothing. */
  async open() {
    partOf(this.box, "created").hidden = true;
    partOf(this.box, "secret").textContent = "";
    partOf(this.box, "code").hidden = partOf(this.box, "loopback").hidden = true;
    writeOrHide(partOf(this.box, "problem"), "");
    await this.#refresh();
  }

  async #refresh() {
    const { available, keys } = await getJson(api("keys")).catch(() => ({ available: false, keys: [] }));
    this.box.hidden = !available && keys.length === 0;
    this.form.hidden = !available;
    partOf(this.box, "by-command").hidden = available;
    partOf(this.box, "list").replaceChildren(...keys.map((/** @type {Key} */ key) => this.#line(key, available)));
  }

  async #create() {
    const values = new FormData(this.form);
    const may = values.get("may");
    const tag = may === "tag" ? String(values.get("tag")).trim() : null;
    const body = { name: values.get("name"), days: Number(values.get("days")), tag, scope: tag === null ? may : null };
    const { secret } = await (await send(api("keys"), "POST", body)).json();
    this.form.reset();
    this.#askForTag();
    partOf(this.box, "created-what").textContent = t(tag === null ? "access.created" : "access.created_tag", { tag: tag ?? "" });
    if (tag === null) partOf(this.box, "secret").textContent = secret;
    else await this.#showLink(tag, secret);
    partOf(this.box, "code").hidden ||= tag === null;
    partOf(this.box, "created").hidden = false;
    await this.#refresh();
    partOf(this.box, "created").scrollIntoView({ block: "nearest" });
  }

  /** @param {string} tag @param {string} secret */
  async #showLink(tag, secret) {
    const { pages } = await readConnect();
    const page = forOthers("tag/", pages);
    const link = linkOf(page ?? new URL("tag/", document.baseURI).href, tag, secret);
    partOf(this.box, "secret").textContent = link;
    partOf(this.box, "loopback").hidden = page !== null;
    await drawCode(/** @type {HTMLImageElement} */ (partOf(this.box, "code")), link);
  }

  #askForTag() {
    const isTag = fieldOf(this.form, "may").value === "tag";
    partOf(this.box, "tag").hidden = !isTag;
    fieldOf(this.form, "tag").disabled = !isTag;
  }

  /** @param {Key} key @param {boolean} isRevocable */
  #line({ id, name, scope, tag, expires_ns }, isRevocable) {
    const what = tag === null ? t(scope === "write" ? "access.word_write" : "access.word_read") : t("access.word_tag", { tag });
    const text = lineOf(name, what, expires_ns);
    if (!isRevocable) return line(text);
    return revocableLine(text, name, () => this.#attempt(async () => {
      await send(api(`keys/${id}`), "DELETE", null);
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
      problem = refusalInForm(error);
    }
    writeOrHide(partOf(this.box, "problem"), problem);
  }
}

/** @param {string} name @param {string} what it allows @param {number | null} expires_ns */
function lineOf(name, what, expires_ns) {
  if (expires_ns === null) return t("access.for_ever", { name, what });
  const time = timeText(expires_ns / 1e6, { dateStyle: "medium" });
  return t(expires_ns / 1e6 < Date.now() ? "access.expired" : "access.until", { name, what, time });
}

/** Return the link that makes a phone a tag. Browsers keep what follows the # to themselves, so no log has the key.
 * @param {string} page @param {string} tag @param {string} secret */
const linkOf = (page, tag, secret) => `${page}#${new URLSearchParams({ tag, key: secret })}`;
