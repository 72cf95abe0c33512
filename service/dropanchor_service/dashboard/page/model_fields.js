/** Fields of forms: made of the JSON schema that validates them, filled, and read. */

import { installUnits, measureText, readMeasure, writeMeasure } from "../data/units.js";
import { element } from "./elements.js";
import { decimal, has, t } from "../i18n/language.js";

/** @typedef {HTMLInputElement | HTMLSelectElement | HTMLTextAreaElement} Field */
/** @typedef {{type?: string, enum?: string[], examples?: any[], anyOf?: Schema[], default?: any, title?: string, description?: string,
 * minimum?: number, exclusiveMinimum?: number, maximum?: number, maxLength?: number}} Schema of a value */

/** What the ends of names say that values are. @type {[string, import("../data/units.js").Kind][]} */
const MEASURES = [["_mps", "velocity"], ["_rad", "angle"], ["_m", "length"]];

/** @param {string} name */
const measureOf = (name) => MEASURES.find(([end]) => name.endsWith(end))?.[1];

/** Return a value in words. @param {any} value */
const wordOf = (value) => (has(`value.${value}`) ? t(`value.${value}`) : String(value));

/** Return the schema of a value that may also be null, without that. @param {Schema} schema */
const within = (schema) => schema.anyOf?.find(({ type }) => type !== "null") ?? schema;

/** Return a value with its unit. @param {string} name @param {any} value in SI units */
export function valueText(name, value) {
  const measure = measureOf(name);
  return measure && typeof value === "number" ? measureText(value, measure) : typeof value === "number" ? decimal(value, 0, 6) : wordOf(value === "" ? null : value);
}

/** Return a label with its field and unit. @param {string} name which ends with the unit @param {Schema} schema @param {string} text */
export function labelled(name, schema, text) {
  const label = element("label", text);
  const { minimum, exclusiveMinimum, maximum } = within(schema);
  const measure = measureOf(name);
  const unit = element("small", name.endsWith("_s") ? "s" : maximum === undefined ? "" : t("rule.range", { least: decimal(minimum ?? 0, 0, 3), most: decimal(maximum, 0, 3) }));
  const field = emptyField(schema);
  Object.assign(field, { name, ...(field.type === "number" ? { min: minimum ?? exclusiveMinimum ?? "", max: maximum ?? "" } : {}) });
  if (measure) unit.dataset.unit = field.dataset.measure = measure;
  label.append(" ", unit, " ", field);
  installUnits(label);
  return label;
}

/** @param {Schema} schema @returns {HTMLInputElement | HTMLSelectElement} */
function emptyField(schema) {
  const { type, maxLength, ...one } = within(schema);
  const isNullable = schema.anyOf !== undefined;
  const values = one.enum ?? (type === "boolean" ? [true, false] : type === "string" ? schema.examples : undefined);
  if (values) {
    const select = document.createElement("select");
    select.dataset.as = "json";
    select.append(...(isNullable ? [null, ...values] : values).map((value) => new Option(wordOf(value), JSON.stringify(value))));
    return select;
  }
  const input = document.createElement("input");
  if (type === "string") return Object.assign(input, { maxLength: maxLength ?? -1, autocomplete: "off" });
  input.dataset.empty = JSON.stringify(schema.default ?? null);
  return Object.assign(input, { type: "number", step: "any", required: schema.default === undefined, placeholder: isNullable ? wordOf(null) : "" });
}

/** Show a value in a field. @param {Field} field @param {any} value */
export function fill(field, value) {
  const { as, measure } = field.dataset;
  if (as === "choice") /** @type {HTMLInputElement} */ (field).checked = value.includes(field.value);
  else if (field.type === "checkbox") /** @type {HTMLInputElement} */ (field).checked = value;
  else if (measure) writeMeasure(/** @type {HTMLInputElement} */ (field), value);
  else if (as === "json") choose(/** @type {HTMLSelectElement} */ (field), value);
  else field.value = Array.isArray(value) ? value.join(", ") : String(value ?? "");
}

/** @param {HTMLSelectElement} select @param {any} value also one that it does not offer */
function choose(select, value) {
  select.value = JSON.stringify(value);
  if (select.value === "") select.append(new Option(wordOf(value), JSON.stringify(value), true, true));
}

/** Return the value in a field. @param {Field} field */
export function valueOf(field) {
  const { as, measure, empty = "null" } = field.dataset;
  const input = /** @type {HTMLInputElement} */ (field);
  if (field.type === "checkbox") return input.checked;
  if (as === "json") return JSON.parse(field.value);
  if (field.type === "number" && field.value === "") return JSON.parse(empty);
  if (measure) return readMeasure(input);
  if (field.type === "number") return input.valueAsNumber;
  if (as === "ids") return field.value.split(/[\s,]+/).filter((part) => part !== "");
  if (as === "labels") return field.value.trim().split(/\s*,\s*/).filter((part) => part !== "");
  return as === "secret" && field.value === "" ? null : field.value.trim();
}
