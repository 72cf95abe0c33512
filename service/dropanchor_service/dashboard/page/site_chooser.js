/** The chooser of the page of one of several sites: all sites, and the way back to their overview. */

import { chosenSite, getJson, sitesUrl } from "../data/connection.js";
import { t } from "../i18n/language.js";

/** Show the chooser in place of the name of the site when there are several. @param {HTMLElement} place @param {HTMLElement} name */
export async function installSites(place, name) {
  const { sites } = await getJson(sitesUrl()).catch(() => ({ sites: [] }));
  if (sites.length < 2) return;
  const list = document.createElement("select");
  list.setAttribute("aria-label", t("sites.choose"));
  const byName = (/** @type {Summary} */ one) => one.name || one.site;
  sites.sort((/** @type {Summary} */ a, /** @type {Summary} */ b) => byName(a).localeCompare(byName(b)));
  list.replaceChildren(...sites.map((/** @type {Summary} */ one) => new Option(byName(one), one.site, false, one.site === chosenSite)));
  list.addEventListener("change", () => location.assign(`?${new URLSearchParams({ site: list.value })}`));
  const all = Object.assign(document.createElement("a"), { href: "sites/", textContent: t("sites.all") });
  place.replaceChildren(list, all);
  place.hidden = false;
  name.hidden = true;
}

/** @typedef {import("../sites/overview.js").Summary} Summary */
