/** The choice of the time zone of a site, and what the page says of it. */

import { setTimeZone, shownZone, timeZone } from "../data/time_zone.js";
import { t } from "../i18n/language.js";
import { byId, write } from "./parts.js";

/** @param {import("../data/connection.js").Connection} connection @param {import("../data/changes.js").Changes} changes */
export function installZoneChoice(connection, changes) {
  const list = /** @type {HTMLSelectElement} */ (byId("zone-of-site"));
  const update = () => {
    /** @type {HTMLElement} */ (list.parentElement).hidden = !changes.mayWrite;
    const { name, isOfSite } = shownZone();
    write(byId("zone-said"), t(isOfSite ? "zone_of.site" : "zone_of.browser", { zone: name }));
    list.value = timeZone() ?? "";
    if (list.value !== (timeZone() ?? "")) list.append(new Option(timeZone(), timeZone(), true, true)); // a former name, such as Asia/Calcutta
  };
  const names = ["UTC", ...Intl.supportedValuesOf("timeZone").filter((name) => name !== "UTC")];
  list.append(new Option(t("zone_of.none"), ""), ...names.map((name) => Object.assign(new Option(name, name), { lang: "en" })));
  list.addEventListener("change", () => changes.editAsIs(t("zone_of.changed"), "site", { time_zone: list.value || null }));
  connection.addEventListener("site", (event) => {
    setTimeZone(/** @type {CustomEvent} */ (event).detail.time_zone);
    update();
  });
  changes.addEventListener("access", update);
  update();
}
