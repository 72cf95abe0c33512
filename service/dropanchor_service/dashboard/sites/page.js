/** The overview of the sites of a service: a list with the states of their tags, and a map of those on Earth. */

import { hasKey, KeyRequiredError, storeKey } from "../data/access.js";
import { getJson } from "../data/connection.js";
import { BEST_FIRST, STATES } from "../data/states.js";
import { translate } from "../i18n/document.js";
import { count, t } from "../i18n/language.js";
import { installLanguages } from "../page/display.js";
import { installTheme } from "../page/theme.js";
import { dots, listed, MAP, nameOf } from "./overview.js";
import { byId, instead } from "../page/parts.js";

const REQUEST_MS = 3000;
/** The answer grows with the sites, so a page of many asks less often. */
const REQUEST_MS_PER_SITE = 10;
const LABELLED = 30;
const SVG = "http://www.w3.org/2000/svg";

translate(document);

/** @typedef {import("./overview.js").Summary} Summary */
let sites = /** @type {Summary[]} */ ([]);
let timer = 0;

/** The page of a site, in the language of this one. @param {Summary} one */
function linkTo(one) {
  const query = new URLSearchParams(location.search);
  query.set("site", one.site);
  return `../?${query}${location.hash}`;
}

async function refresh() {
  clearTimeout(timer);
  try {
    const answer = await getJson(new URL("../api/v1/sites", document.baseURI));
    sites = answer.sites;
    showUnavailable(answer.unavailable ?? []);
    become("live");
    show();
  } catch (error) {
    become(error instanceof KeyRequiredError ? "locked" : "lost");
    if (error instanceof KeyRequiredError) return;
  }
  timer = setTimeout(refresh, REQUEST_MS + REQUEST_MS_PER_SITE * sites.length);
}

/** Name the buckets whose sites nobody serves now. @param {string[]} buckets */
function showUnavailable(buckets) {
  byId("unavailable").hidden = buckets.length === 0;
  byId("unavailable").textContent = t("sites.unavailable", { buckets: buckets.join(", ") });
}

/** @param {"live" | "lost" | "locked"} status */
function become(status) {
  byId("status").dataset.status = status;
  byId("status-text").textContent = t(`status.${status}`);
  byId("lost").hidden = status !== "lost";
  byId("locked").hidden = status !== "locked";
  byId("refused").hidden = !hasKey();
  if (status !== "lost") byId("overview").hidden = status === "locked";
}

function show() {
  const shown = listed(sites, /** @type {HTMLInputElement} */ (byId("find")).value);
  byId("count").textContent = t("count.of", { shown: shown.length, all: sites.length });
  byId("none").hidden = shown.length > 0;
  const focused = /** @type {HTMLElement | null} */ (document.activeElement)?.dataset.site;
  byId("sites").replaceChildren(...shown.map(row));
  drawMap(shown);
  if (focused !== undefined) /** @type {HTMLElement | null} */ (document.querySelector(`tbody a[data-site="${CSS.escape(focused)}"]`))?.focus();
}

/** @param {Summary} one */
function row(one) {
  const line = document.createElement("tr");
  const name = Object.assign(document.createElement("th"), { scope: "row" });
  const link = Object.assign(document.createElement("a"), { href: linkTo(one), textContent: nameOf(one) });
  link.dataset.site = one.site;
  name.append(link);
  const cells = [one.tags, one.online, one.needs_care].map((number) => Object.assign(document.createElement("td"), { className: "number", textContent: count(number) }));
  if (one.needs_care > 0) cells[2].classList.add("care");
  const states = document.createElement("td");
  states.append(statesOf(one));
  line.append(name, ...cells, states);
  return line;
}

/** @param {Summary} one */
function statesOf(one) {
  const list = Object.assign(document.createElement("div"), { className: "states" });
  for (const { name, label } of BEST_FIRST.map((state) => STATES[state])) {
    const tags = one.states[name];
    if (!tags) continue;
    const part = Object.assign(document.createElement("span"), { textContent: `${count(tags)} ${label}` });
    part.dataset.state = name;
    list.append(part);
  }
  if (one.tags === 0) list.textContent = t("sites.no_tags");
  return list;
}

/** @param {Summary[]} shown */
function drawMap(shown) {
  const map = byId("map");
  const placed = dots(shown);
  map.toggleAttribute("hidden", placed.length === 0);
  map.setAttribute("viewBox", `0 0 ${MAP.width} ${MAP.height}`);
  map.replaceChildren(...placed.map(({ site, x, y }) => {
    const link = document.createElementNS(SVG, "a");
    link.setAttribute("href", linkTo(site));
    link.setAttribute("class", site.needs_care > 0 ? "care" : "");
    link.setAttribute("aria-label", t("sites.map_of", { site: nameOf(site), tags: t("count.tags", { n: site.tags }) }));
    link.append(shape("circle", { cx: x, cy: y, r: 8 }));
    if (placed.length <= LABELLED) link.append(shape("text", { x: x + 12, y: y + 5 }, nameOf(site)));
    return link;
  }));
}

/** @param {string} kind @param {Record<string, number>} values @param {string} [text] */
function shape(kind, values, text = "") {
  const element = document.createElementNS(SVG, kind);
  for (const [name, value] of Object.entries(values)) element.setAttribute(name, value.toFixed(1));
  element.textContent = text;
  return element;
}

byId("find").addEventListener("input", show);
instead(byId("locked"), "submit", () => {
  const field = /** @type {HTMLInputElement} */ (byId("key"));
  storeKey(field.value.trim());
  field.value = "";
  refresh();
});
installTheme(/** @type {HTMLButtonElement} */ (byId("theme")), () => {});
installLanguages(/** @type {HTMLSelectElement} */ (byId("language")));
refresh();
