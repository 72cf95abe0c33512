/** Apply to a site what its tags tell about north. */

import { compassTurn } from "../data/format.js";
import { t } from "../i18n/language.js";

/** Return whether the cure of a tag's uncertainty is what others of its site know.
 * @param {import("../data/evidence.js").Explanation | null} explanation */
export const isNorthOffered = (explanation) => (explanation?.uncertainty?.phrase.values["cure.code"] ?? "").startsWith("site_north");

/** Turn north of the site, unless the tags no longer tell that it is off. @param {import("../data/changes.js").Changes} changes */
export function applyNorth(changes) {
  return changes.attempt(async () => {
    const { value } = await changes.read("site/north");
    if (!value.offered) return;
    const turn = compassTurn(value.learned_rad - value.declination_rad);
    const patch = { declination_rad: value.learned_rad, declination_std_rad: value.std_rad };
    await changes.editAsIs(t("north.applied", { turn }), "site", patch);
  });
}
