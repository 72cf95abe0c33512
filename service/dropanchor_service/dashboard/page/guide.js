/** The guide to what is open: the dialog of the keys (`?`) leads to it, in another tab. */

import { t } from "../i18n/language.js";

const EVENTS = "how-to/react-to-events.md";
const PAGE = "how-to/use-the-page.md";
const PAST = "how-to/look-at-the-past.md";
const SITE = "how-to/set-up-a-site.md";

/** The page of the documentation for each panel, in the order in which one of several open panels counts.
 * @type {Record<Exclude<import("./one_panel.js").PanelName, "keys">, string>} */
export const GUIDES = {
  display: PAGE,
  sharing: "how-to/secure-a-site.md",
  trail: PAGE + "#settings-and-changes",
  figures: PAST + "#figures-of-all-tags",
  start: SITE + "#say-where-a-tag-is",
  anchors: SITE + "#place-the-anchors",
  plans: "how-to/show-a-floor-plan.md",
  zone: EVENTS + "#make-a-zone",
  destination: EVENTS + "#send-events-to-people-and-systems",
  rule: EVENTS + "#rules-without-a-zone",
  measure: PAGE,
  heat: PAST + "#the-heat-map",
  past: PAST,
  several: PAGE + "#several-tags",
  tag: "how-to/read-states.md",
};

/** Return the page for what is open. @param {Record<string, boolean>} isOpen by the names of the panels @param {boolean} inLists whether
 * a list of events, zones or alerts is open */
export function guideTo(isOpen, inLists) {
  const open = Object.entries(GUIDES).find(([name]) => isOpen[name]);
  return open?.[1] ?? (inLists ? EVENTS : PAGE);
}

/** Let a link lead to a page, and say what it is called. @param {HTMLAnchorElement} link @param {string} page */
export function leadTo(link, page) {
  link.href = `help/${page}`;
  link.textContent = t("keys.guide", { guide: page.replace(/^how-to\/|\.md.*$/g, "").replaceAll("-", " ") });
}
