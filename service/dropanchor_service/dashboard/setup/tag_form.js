/** The form of the settings of a tag, made of the model that validates them: fill it, and read it. */

import { element } from "../page/elements.js";
import { api, getJson } from "../data/connection.js";
import { sourceOf } from "../data/trail.js";
import { has, t } from "../i18n/language.js";
import { begun, said } from "../i18n/said.js";
import { fill, labelled, valueOf, valueText } from "../page/model_fields.js";
import { partOf, write, writeOrHide } from "../page/parts.js";

/** @typedef {import("../page/model_fields.js").Field} Field @typedef {import("../page/model_fields.js").Schema} Schema */

/** Those that people set most. The others follow as the model has them; `start` has a form of its own. */
const FIRST = ["name", "group", "colour", "motion", "mount_angle_rad", "height_m"];

/** Make a field of each setting that the service knows. @param {HTMLFormElement} form */
export async function makeFields(form) {
  /** @type {{properties: Record<string, Schema>}} */
  const { properties } = await getJson(new URL("schemas/tag_settings.json", document.baseURI));
  const boxOf = (/** @type {string} */ name) => box(name, properties[name]);
  partOf(form, "groups").after(...FIRST.map(boxOf));
  partOf(form, "more").append(...Object.keys(properties).filter((name) => name !== "start" && !FIRST.includes(name)).map(boxOf));
}

/** @param {string} name @param {Schema} schema */
function box(name, schema) {
  const made = element("div", "", "setting");
  const label = labelled(name, schema, has(`model.${name}`) ? t(`model.${name}`) : schema.title ?? name);
  const field = /** @type {HTMLElement} */ (label.lastElementChild);
  const [what, from, problem] = [whatIs(name, schema), "", ""].map((text) => element("small", text));
  [from.dataset.from, problem.className, problem.hidden] = [valueText(name, schema.default), "problem", true];
  problem.setAttribute("role", "alert");
  [made, what, problem].forEach((one, i) => (one.id = `setting-${["", "what-", "problem-"][i]}${name}`));
  field.setAttribute("aria-describedby", `${what.id} ${problem.id}`);
  field.addEventListener("input", () => refuse(field, ""));
  made.append(label, what, from, problem);
  return made;
}

/** @param {string} name @param {Schema} schema */
function whatIs(name, { description = "" }) {
  return has(`model.${name}.what`) ? t(`model.${name}.what`) : description.replaceAll("`", "").replace(/\bnull\b/g, t("value.null"));
}

/** @param {HTMLFormElement} form */
const fieldsOf = (form) => /** @type {Field[]} */ ([...form.elements]).filter(({ name }) => name !== "");

/** @param {HTMLFormElement} form @param {Record<string, any>} settings */
export function fillForm(form, settings) {
  for (const field of fieldsOf(form)) {
    fill(field, settings[field.name]);
    field.dataset.shown = field.value;
    refuse(field, "");
  }
  noteSent(form, false);
}

/** Say where the value of each setting is from. @param {HTMLFormElement} form @param {string} tag */
export async function showSources(form, tag) {
  /** @type {{values: import("../data/trail.js").Setting[]}} */
  const { values } = await getJson(api(`settings?tag=${encodeURIComponent(tag)}`));
  for (const setting of values) {
    const from = /** @type {HTMLElement | null} */ (form.querySelector(`#setting-${setting.path[2]} [data-from]`));
    if (from) write(from, t("setup.source", { value: from.dataset.from, source: sourceOf(setting, setting.path) }));
  }
}

/** Say at each field why the service refused its value. @param {HTMLFormElement} form @param {unknown} error */
export function showRefused(form, error) {
  const { errors = [] } = /** @type {{problem?: import("../i18n/said.js").Problem}} */ (error).problem ?? {};
  for (const field of fieldsOf(form)) {
    const wrong = errors.find(({ location }) => location === `body.${field.name}`);
    if (wrong) refuse(field, begun(said(wrong.detail, wrong.detail_phrase)));
  }
  form.querySelector("[aria-invalid]")?.scrollIntoView({ block: "nearest" });
}

/** @param {HTMLElement} field @param {string} why empty: it is not refused */
function refuse(field, why) {
  const problem = field.closest(".setting")?.querySelector(".problem");
  if (problem instanceof HTMLElement) writeOrHide(problem, why);
  field.toggleAttribute("aria-invalid", why !== "");
}

/** Return what a person has seen or is saving. @param {Field} field */
const known = ({ dataset }) => dataset.sent ?? dataset.shown;

/** Return whether a person has typed what is neither saved nor being saved. @param {Field} field */
const isTyped = (field) => field.value !== known(field);

/** Note that what the form shows now is being saved, or that it is not. @param {HTMLFormElement} form @param {boolean} isSent */
export function noteSent(form, isSent) {
  for (const { dataset, value } of fieldsOf(form)) isSent ? (dataset.sent = value) : delete dataset.sent;
}

/** Return what puts back what a person has typed and not saved, after the form was filled anew, and returns whether somebody else has
 * changed one of these fields. @param {HTMLFormElement} form */
export function typedIn(form) {
  const typed = fieldsOf(form).filter(isTyped).map((field) => ({ field, value: field.value, was: known(field) }));
  return () => {
    typed.forEach(({ field, value }) => (field.value = value));
    return typed.some(({ field, was }) => field.dataset.shown !== was);
  };
}

/** Return the settings that a person has changed. @param {HTMLFormElement} form */
export const patchOf = (form) => Object.fromEntries(fieldsOf(form).filter(isTyped).map((field) => [field.name, valueOf(field)]));
