/** Fill the form of a tag's settings, and read it. */

import { readMeasure, writeMeasure } from "../data/units.js";
import { t } from "../i18n/language.js";
import { fieldOf } from "../page/parts.js";

const DEGREES = 180 / Math.PI;
const FIELDS = ["name", "group", "colour", "motion", "mount", "height"];

/** Colours that differ for people with any colour vision, and that show on both themes. */
const COLOURS = [
  ["blue", "#2f7fd0"], ["orange", "#d97a0a"], ["green", "#1b8a6b"], ["yellow", "#b89b00"], ["pink", "#c7609a"],
  ["red", "#cf4a12"], ["grey", "#7a8793"],
];

/** Return the number in a field; null when it is empty. @param {HTMLInputElement} input */
export const numberOf = (input) => (Number.isNaN(input.valueAsNumber) ? null : input.valueAsNumber);

/** @param {HTMLFormElement} form @param {Record<string, any>} settings @param {Set<string>} groups that other tags have */
export function fillForm(form, settings, groups) {
  const colour = /** @type {HTMLSelectElement} */ (form.elements.namedItem("colour"));
  const known = COLOURS.some(([, value]) => value === settings.colour);
  const choices = [[t("colour.none"), ""], ...COLOURS.map(([name, value]) => [t(`colour.${name}`), value]), ...(settings.colour && !known ? [[settings.colour, settings.colour]] : [])];
  colour.replaceChildren(...choices.map(([text, value]) => new Option(text, value)));
  const angle = settings.mount_angle_rad;
  /** @type {Record<string, string>} */
  const texts = {
    name: settings.name, group: settings.group, colour: settings.colour ?? "", motion: settings.motion,
    mount: angle === null ? "" : String(Math.round(angle * DEGREES * 10) / 10),
  };
  for (const [name, text] of Object.entries(texts)) fieldOf(form, name).value = fieldOf(form, name).dataset.shown = text;
  noteSent(form, false);
  writeMeasure(fieldOf(form, "height"), (settings.height_told ?? settings.height_m !== 0) ? settings.height_m : null);
  form.querySelector("datalist")?.replaceChildren(...[...groups].sort().map((group) => new Option(group)));
}

/** Return what a person has seen or is saving. @param {HTMLInputElement} input */
const known = ({ dataset }) => dataset.sent ?? dataset.shown;

/** Return whether a person has typed what is neither saved nor being saved. @param {HTMLInputElement} input */
const isTyped = (input) => input.value !== known(input);

/** Note that what the form shows now is being saved, or that it is not. @param {HTMLFormElement} form @param {boolean} isSent */
export function noteSent(form, isSent) {
  for (const { dataset, value } of FIELDS.map((name) => fieldOf(form, name))) isSent ? (dataset.sent = value) : delete dataset.sent;
}

/** Return what puts back what a person has typed and not saved, after the form was filled anew, and returns whether somebody else has
 * changed one of these fields. @param {HTMLFormElement} form */
export function typedIn(form) {
  const typed = FIELDS.map((name) => fieldOf(form, name)).filter(isTyped).map((input) => ({ input, value: input.value, was: known(input) }));
  return () => {
    typed.forEach(({ input, value }) => (input.value = value));
    return typed.some(({ input, was }) => input.dataset.shown !== was);
  };
}

/** Return the settings that a person has changed. @param {HTMLFormElement} form */
export function patchOf(form) {
  const angle = numberOf(fieldOf(form, "mount"));
  const height_m = readMeasure(fieldOf(form, "height"));
  const values = [
    ["name", "name", fieldOf(form, "name").value.trim()],
    ["group", "group", fieldOf(form, "group").value.trim()],
    ["colour", "colour", fieldOf(form, "colour").value || null],
    ["motion", "motion", fieldOf(form, "motion").value],
    ["mount", "mount_angle_rad", angle === null ? null : angle / DEGREES],
    ["height", "height_m", height_m ?? 0],
    ["height", "height_told", height_m === 0 ? true : null], // 0 is also what a tag has that nobody told one
  ];
  return Object.fromEntries(values.filter(([name]) => isTyped(fieldOf(form, String(name)))).map(([, key, value]) => [key, value]));
}
