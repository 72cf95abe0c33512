/** Connect alerts: who is told about events, and the rules that make them. */

import { listLanguages } from "../i18n/document.js";
import { begun, said } from "../i18n/said.js";
import { language, t } from "../i18n/language.js";
import { kind, kindOfRule, KINDS } from "../zones/words.js";
import { shareToken } from "../data/shared.js";
import { confirmed } from "../setup/confirm.js";
import { AlertStore } from "./alert_store.js";
import { DestinationList } from "./destination_list.js";
import { ItemEditor } from "./item_editor.js";
import { ItemForm } from "./item_form.js";
import { button, element } from "../page/elements.js";
import { NetworkList } from "./network_list.js";
import { RuleList } from "./rule_list.js";
import { SecretField, newSecret } from "./secret_field.js";
import { ruleModels } from "./rule_models.js";
import { stuckIn } from "./words.js";
import { partOf, writeOrHide } from "../page/parts.js";

const COMMON = { enabled: true, types: [], zones: [], tags: [] };
/** @type {Record<string, Record<string, any>>} */
const NEW_DESTINATIONS = {
  email: { ...COMMON, type: "email", to: [], digest_s: 60, language },
  webhook: { ...COMMON, type: "webhook", url: "", secret: null },
  mqtt: { ...COMMON, type: "mqtt", topic: "dropanchor/{site}/{tag}/event" },
  mqtt_poses: { enabled: true, zones: [], tags: [], type: "mqtt_poses", prefix: "dropanchor", discovery: "homeassistant", interval_s: 1, deadband_m: 0.1 },
};
const SEVERITIES = ["event", "warning", "alarm"];

export class Alerts {
  store = new AlertStore();
  #isOffered = false;

  /** @param {HTMLDetailsElement} box @param {HTMLDialogElement} dialog @param {import("../data/connection.js").Connection} connection
   * @param {import("../zones/zones.js").Zones} zones @param {import("../data/changes.js").Changes} changes
   * @param {import("../page/one_panel.js").Panels} panels */
  constructor(box, dialog, connection, zones, changes, panels) {
    this.box = box;
    this.zones = zones;
    this.panels = panels;
    this.confirm = (/** @type {string} */ question, /** @type {string} */ action) => confirmed(dialog, question, action);
    const { store } = this;
    this.destinationEditor = new ItemEditor("destination", store.destinations, () => store.states.map(({ destination }) => destination), changes);
    this.ruleEditor = new ItemEditor("rule", store.rules, () => store.allRules, changes);
    this.destinations = new DestinationList(partOf(this.box, "destinations"), store, { edit: (id) => panels.open("destination", () => this.destinationEditor.open(id)), confirm: this.confirm, isLeaving: (id) => changes.isLeaving(store.destinations.path(id)) });
    this.rules = new RuleList(partOf(this.box, "rules"), store, () => zones.store.zones, { edit: (id) => panels.open("rule", () => this.ruleEditor.open(id)), editZone: (id) => zones.edit(id) });
    this.networks = new NetworkList(partOf(this.box, "networks"), store);
    for (const list of document.querySelectorAll("select[data-severities]")) list.append(...SEVERITIES.map((one) => new Option(t(`severity.${one}`), one)));
    this.#addForms();
    this.#addPanel("destination", this.destinationEditor);
    for (const one of /** @type {NodeListOf<HTMLElement>} */ (partOf(this.box, "new-destination").querySelectorAll("button"))) {
      const type = one.dataset.type ?? "";
      one.addEventListener("click", () => this.#mayMake(type) && panels.open("destination", () => this.destinationEditor.begin({ ...NEW_DESTINATIONS[type], ...(type === "webhook" ? { secret: newSecret() } : {}) })));
    }
    this.#addPanel("rule", this.ruleEditor);
    for (const part of [store, this.destinationEditor, this.ruleEditor, zones.store]) part.addEventListener("change", () => this.#update());
    changes.addEventListener("done", (event) => /^(destinations|event-rules)\//.test(/** @type {CustomEvent} */ (event).detail) && store.refresh());
    connection.addEventListener("status", () => (connection.status === "live" ? store.start() : store.stop()));
  }

  #addForms() {
    const { store } = this;
    partOf(this.box, "kinds").append(...KINDS.map((type) => {
      const label = element("label", "", "check");
      label.append(Object.assign(document.createElement("input"), { name: "types", type: "checkbox", value: type }), ` ${kind(type)}`);
      label.firstElementChild?.setAttribute("data-as", "choice");
      return label;
    }));
    listLanguages(/** @type {HTMLSelectElement} */ (partOf(this.box, "language")));
    const form = /** @type {HTMLFormElement} */ (partOf(this.box, "destination-form"));
    new ItemForm(form, this.destinationEditor, {
      title: ({ id, type }, isNew) => (isNew ? t(`alerts.new_${type}`) : t("destination.title", { id })),
      mayDelete: () => store.isAdmin,
      ask: () => this.confirm(t("destination.question"), t("destination.delete")),
    });
    new SecretField(form, this.destinationEditor);
    this.networks.offerIn(form, this.destinationEditor);
    new ItemForm(/** @type {HTMLFormElement} */ (partOf(this.box, "rule-form")), this.ruleEditor, {
      title: ({ type }, isNew) => (isNew ? t("rule.new", { rule: kindOfRule(type) }) : kindOfRule(type)),
      mayDelete: () => store.isAdmin,
      ask: () => this.confirm(t("rule.question"), t("rule.delete")),
    });
  }

  /** Register a form. @param {"destination" | "rule"} name @param {ItemEditor} editor */
  #addPanel(name, editor) {
    this.panels.add(name, { isOpen: () => editor.item !== null, isUnsaved: () => editor.isUnsaved, saving: () => editor.saving.now, leave: () => editor.close() });
  }

  /** Offer the rules that the service knows, once it has said which. It is asked again when it has not. */
  async #offerRules() {
    if (this.#isOffered) return;
    this.#isOffered = true;
    try {
      for (const { type, begin, fields } of await ruleModels()) {
        const name = t("alerts.new_rule", { kind: kindOfRule(type) });
        partOf(this.box, "new-rule").append(button(name, name, () => this.panels.open("rule", () => this.ruleEditor.begin(begin))));
        partOf(this.box, "own-values").before(...fields);
      }
    } catch {
      this.#isOffered = false;
    }
  }

  /** Return whether the service can have a destination of a type. If not, say what it lacks before anybody fills a form.
   * @param {string} type */
  #mayMake(type) {
    const why = this.store.unavailable[type] ?? "";
    writeOrHide(partOf(this.box, "lacking"), begun(said(why, this.store.unavailable_phrases[type])));
    return why === "";
  }

  #update() {
    const { store } = this;
    if (store.mayWrite) this.#offerRules();
    const stuck = stuckIn(store.states);
    const summary = partOf(this.box, "summary");
    summary.hidden = partOf(this.box, "who").hidden = shareToken !== null;
    summary.textContent = stuck > 0 ? t("alerts.stuck", { n: stuck }) : store.states.length === 0 ? t("alerts.nobody_short") : t("alerts.destination_count", { n: store.states.length });
    summary.classList.toggle("failing", stuck > 0);
    const editing = this.destinationEditor.item !== null || this.ruleEditor.item !== null;
    partOf(this.box, "lists").hidden = editing;
    partOf(this.box, "new-destination").hidden = !store.isAdmin;
    partOf(this.box, "new-rule").hidden = !store.mayWrite;
    partOf(this.box, "no-destination").hidden = shareToken !== null || store.states.length > 0;
    this.destinations.update();
    this.rules.update();
    this.networks.update();
  }
}
