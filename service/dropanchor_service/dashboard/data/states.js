/** The tracking states, and how far a pose in each can be trusted. */

import { t } from "../i18n/language.js";

/**
 * @typedef {object} StateStyle
 * @property {string} name as in the contract
 * @property {string} label
 * @property {string} meaning one sentence for people
 * @property {"disc"|"diamond"|"triangle"|"square"|"ring"|"dotted"|"cross"} shape differs per state, so colour is never needed
 * @property {boolean} placed whether x and y may be shown as the position of the tag
 * @property {boolean} trusted whether the pose is as good as the service can make it
 */

/** @param {string} name */
function wordsOf(name) {
  return { name, label: t(`state.${name}`), meaning: t(`state.${name}.meaning`) };
}

/** @type {readonly StateStyle[]} */
export const STATES = Object.freeze([
  { ...wordsOf("initialising"), shape: "dotted", placed: false, trusted: false },
  { ...wordsOf("ambiguous"), shape: "ring", placed: false, trusted: false },
  { ...wordsOf("tracking"), shape: "disc", placed: true, trusted: true },
  { ...wordsOf("coasting"), shape: "diamond", placed: true, trusted: false },
  { ...wordsOf("degraded"), shape: "square", placed: true, trusted: false },
  { ...wordsOf("lost"), shape: "cross", placed: false, trusted: false },
  { ...wordsOf("relative"), shape: "triangle", placed: false, trusted: false },
]);

/** The style of every tag while no newer pose can arrive, since its state may have changed.
 * @type {Readonly<StateStyle>} */
export const OUT_OF_DATE = Object.freeze({
  ...wordsOf("outdated"),
  shape: "dotted", placed: false, trusted: false,
});

const LOST = 5;
const NUMBERS = new Map(STATES.map((state, number) => [state.name, number]));

/**
 * Return the number of a state. An unknown state counts as the least trusted one.
 * @param {string | null | undefined} name
 */
export function stateNumber(name) {
  return NUMBERS.get(name ?? "initialising") ?? LOST;
}

/** The states from the most to the least trusted. */
export const BEST_FIRST = ["tracking", "relative", "coasting", "degraded", "ambiguous", "initialising", "lost"].map(stateNumber);

export const AMBIGUOUS = stateNumber("ambiguous");

/**
 * Return the number of the state of a pose. Services before the state "relative" name it in `frame` alone.
 * @param {string | null} name
 * @param {string | null | undefined} frame
 */
export const stateIn = (name, frame) => stateNumber(frame === "relative" && STATES[stateNumber(name)].placed ? "relative" : name);

/** Seconds after which a pose is drawn hollow and fainter, and after which it is even fainter. */
export const STALE_S = 2;
export const OLD_S = 10;

/**
 * 0 fresh, 1 stale, 2 old.
 * @param {number} age_s
 * @returns {0 | 1 | 2}
 */
export function staleness(age_s) {
  if (!(age_s >= STALE_S)) return Number.isNaN(age_s) ? 2 : 0;
  return age_s >= OLD_S ? 2 : 1;
}
