/** Connect alerts: who is told about events, and the rules that make them. */

import { listLanguages } from "../i18n/document.js";
import { language, t } from "../i18n/language.js";
import { shareToken } from "../data/shared.js";
import { confirmed } from "../setup/confirm.js";
import { AlertStore } from "./alert_store.js";
import { DestinationList } from "./destination_list.js";
import { ItemEditor } from "./item_editor.js";
import { ItemForm } from "./item_form.js";
import { RuleList } from "./rule_list.js";
import { stuckIn } from "./words.js";

const COMMON = { enabled: true, types: [], zones: [], tags: [] };
/** @type {Record<string, Record<string, any>>} */
const NEW_DESTINATIONS = {
  email: { ...COMMON, type: "email", to: [], digest_s: 60, language },
  webhook: { ...COMMON, type: "webhook", url: "", secret: null },
  mqtt: { ...COMMON, type: "mqtt", topic: "dropanchor/{site}/{tag}/event" },
};
const FOR_ALL = { name: "", tags: [], groups: [] };
/** @type {Record<string, Record<string, any>>} */
const NEW_RULES = {
  too_close: { ...FOR_ALL, type: "too_close", distance_m: 3, delay_s: 1 },
  battery_low: { ...FOR_ALL, type: "battery_low", fraction: 0.2 },
  lost: { ...FOR_ALL, type: "lost", after_s: 60 },
  ambiguous: { ...FOR_ALL, type: "ambiguous", after_s: 120 },
};

export class Alerts {
  store = new AlertStore();

  /** @param {HTMLDetailsElement} box @param {HTMLDialogElement} dialog @param {import("../data/connection.js").Connection} connection
   * @param {import("../zones/zones.js").Zones} zones */
  constructor(box, dialog, connection, zones) {
    this.box = box;
    this.zones = zones;
    this.confirm = (/** @type {string} */ question, /** @type {string} */ action) => confirmed(dialog, question, action);
    const { store } = this;
    this.destinationEditor = new ItemEditor(store.destinations, () => store.states.map(({ destination }) => destination));
    this.ruleEditor = new ItemEditor(store.rules, () => store.allRules);
    this.destinations = new DestinationList(this.#part("destinations"), store, { edit: (id) => this.#edit(this.destinationEditor, id), confirm: this.confirm });
    this.rules = new RuleList(this.#part("rules"), store, () => zones.store.zones, { edit: (id) => this.#edit(this.ruleEditor, id), editZone: (id) => zones.edit(id) });
    this.#addForms();
    this.#addButtons("new-destination", (type) => this.#begin(this.destinationEditor, NEW_DESTINATIONS[type]));
    this.#addButtons("new-rule", (type) => this.#begin(this.ruleEditor, NEW_RULES[type]));
    for (const part of [store, this.destinationEditor, this.ruleEditor, zones.store]) part.addEventListener("change", () => this.#update());
    for (const editor of [this.destinationEditor, this.ruleEditor]) editor.addEventListener("saved", () => store.refresh());
    connection.addEventListener("status", () => (connection.status === "live" ? store.start() : store.stop()));
  }

  #addForms() {
    const { store } = this;
    listLanguages(/** @type {HTMLSelectElement} */ (this.#part("language")));
    new ItemForm(/** @type {HTMLFormElement} */ (this.#part("destination-form")), this.destinationEditor, {
      title: ({ id, type }, isNew) => (isNew ? t(`alerts.new_${type}`) : t("destination.title", { id })),
      mayDelete: () => store.isAdmin,
      ask: () => this.confirm(t("destination.question"), t("destination.delete")),
    });
    new ItemForm(/** @type {HTMLFormElement} */ (this.#part("rule-form")), this.ruleEditor, {
      title: ({ type }, isNew) => (isNew ? t("rule.new", { rule: t(`rule.${type}`) }) : t(`rule.${type}`)),
      mayDelete: () => store.isAdmin,
      ask: () => this.confirm(t("rule.question"), t("rule.delete")),
    });
  }

  /** @param {string} name @returns {HTMLElement} */
  #part(name) {
    return /** @type {HTMLElement} */ (this.box.querySelector(`[data-part="${name}"]`));
  }

  /** @param {string} name @param {(type: string) => void} begin */
  #addButtons(name, begin) {
    for (const one of /** @type {NodeListOf<HTMLElement>} */ (this.#part(name).querySelectorAll("button"))) {
      one.addEventListener("click", () => begin(/** @type {string} */ (one.dataset.type)));
    }
  }

  /** @param {ItemEditor} editor @param {Record<string, any>} item */
  #begin(editor, item) {
    this.#other(editor).close();
    editor.begin(item);
  }

  /** @param {ItemEditor} editor @param {string} id */
  #edit(editor, id) {
    this.#other(editor).close();
    editor.open(id);
  }

  /** @param {ItemEditor} editor */
  #other(editor) {
    return editor === this.ruleEditor ? this.destinationEditor : this.ruleEditor;
  }

  #update() {
    const { store } = this;
    const stuck = stuckIn(store.states);
    const summary = this.#part("summary");
    summary.hidden = this.#part("who").hidden = shareToken !== null;
    summary.textContent = stuck > 0 ? t("alerts.stuck", { n: stuck }) : store.states.length === 0 ? t("alerts.nobody_short") : t("alerts.destination_count", { n: store.states.length });
    summary.classList.toggle("failing", stuck > 0);
    const editing = this.destinationEditor.item !== null || this.ruleEditor.item !== null;
    this.#part("lists").hidden = editing;
    this.#part("new-destination").hidden = !store.isAdmin;
    this.#part("new-rule").hidden = !store.mayWrite;
    this.#part("no-destination").hidden = shareToken !== null || store.states.length > 0;
    this.destinations.update();
    this.rules.update();
  }
}
