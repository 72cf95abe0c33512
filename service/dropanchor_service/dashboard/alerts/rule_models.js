/** The rules that the service knows, from the schema that validates them. */

import { getJson } from "../data/connection.js";
import { t } from "../i18n/language.js";
import { labelled } from "../page/model_fields.js";
import { ownValues } from "./words.js";

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
    const fields = own.map((name) => labelled(name, { ...properties[name], default: undefined }, t(`rule.field.${name}`)));
    for (const { dataset } of fields) dataset.for = type;
    return { type, begin, fields };
  });
}
