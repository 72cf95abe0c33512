/** The rules that the service knows, from the schema that validates them. */

import { getJson } from "../data/connection.js";
import { installUnits } from "../data/units.js";
import { decimal, t } from "../i18n/language.js";
import { ownValues } from "./words.js";
import { element } from "./lines.js";

/** @typedef {{minimum: number, maximum: number, default?: number, examples?: number[]}} Schema of a number */
/** @typedef {{properties: Record<string, any>}} Model */

/** Return what each type of rule begins with, and the fields of the values that only some types have.
 * @returns {Promise<{type: string, begin: Record<string, any>, fields: HTMLElement[]}[]>} */
export async function ruleModels() {
  const { $defs, discriminator } = await getJson(new URL("schemas/event_rule.json", document.baseURI));
  return Object.entries(discriminator.mapping).map(([type, path]) => {
    const { properties } = /** @type {Model} */ ($defs[path.split("/").at(-1)]);
    const own = ownValues(properties);
    const values = own.map((name) => [name, properties[name].default ?? properties[name].examples[0]]);
    const begin = { name: "", tags: [], groups: [], severity: "alarm", type, ...Object.fromEntries(values) };
    return { type, begin, fields: own.map((name) => fieldOf(type, name, properties[name])) };
  });
}

/** @param {string} type @param {string} name which ends with the unit @param {Schema} schema */
function fieldOf(type, name, { minimum, maximum }) {
  const label = element("label", t(`rule.field.${name}`));
  const unit = element("small", name.endsWith("_s") ? "s" : t("rule.range", { least: decimal(minimum, 0, 3), most: decimal(maximum, 0, 3) }));
  const input = Object.assign(document.createElement("input"), { name, type: "number", step: "any", min: minimum, max: maximum, required: true });
  const measure = name.endsWith("_mps") ? "velocity" : name.endsWith("_m") ? "length" : "";
  if (measure) unit.dataset.unit = input.dataset.measure = measure;
  label.dataset.for = type;
  label.append(" ", unit, " ", input);
  installUnits(label);
  return label;
}
