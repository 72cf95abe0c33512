/** What a person can do about a tag. */

import { said } from "../i18n/said.js";

/** Return the hint about the pose, or else that about the samples; empty: nothing needs to be done.
 * @param {import("../data/fleet.js").Fleet} fleet @param {import("../data/roster.js").Roster} roster @param {number} row */
export function hintOf({ value, names }, roster, row) {
  const ofPose = value.hint[row];
  if (ofPose) return said(ofPose, value.hint_phrase[row]);
  const status = roster.of(names[row]);
  return status ? said(status.hint, status.hint_phrase) : "";
}
