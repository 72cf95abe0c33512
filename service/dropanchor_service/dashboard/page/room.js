/** Share the room of the page: the column beside the map, the details below the list, and on a phone the sheet and the tools. */

import { t } from "../i18n/language.js";
import { Splitter } from "./splitter.js";

/** From here on, the button of the sheet puts it down. */
const UP_PERCENT = 65;
const PULLED_UP_PERCENT = 88;

/** @param {(id: string) => HTMLElement} byId */
export function installRoom(byId) {
  const main = /** @type {HTMLElement} */ (document.querySelector("main"));
  const aside = /** @type {HTMLElement} */ (document.querySelector("aside"));
  const details = () => /** @type {HTMLElement} */ (aside.querySelector(".detail:not([hidden])") ?? byId("detail"));
  new Splitter(byId("side-bar"), { name: "side", variable: "--side", part: () => aside, whole: main, least: 25, most: 75 });
  new Splitter(byId("detail-bar"), { name: "details", variable: "--details", part: details, whole: aside, least: 15, most: 80 });
  const sheet = new Splitter(byId("sheet-bar"), { name: "sheet", variable: "--sheet", part: () => aside, whole: main, least: 30, most: PULLED_UP_PERCENT });
  installPull(byId("sheet-pull"), sheet);
  installFold(byId("tools-fold"), byId("tools"));
}

/** Let a button do what dragging the sheet does. @param {HTMLElement} button @param {Splitter} sheet */
function installPull(button, sheet) {
  const update = () => {
    const isUp = sheet.value >= UP_PERCENT;
    button.setAttribute("aria-expanded", String(isUp));
    button.title = t(isUp ? "sheet.put_down" : "sheet.pull_up");
    button.setAttribute("aria-label", button.title);
  };
  button.addEventListener("click", () => sheet.move(sheet.value >= UP_PERCENT ? null : PULLED_UP_PERCENT));
  sheet.addEventListener("change", update);
  update();
}

/** Unfold the tools of the map with one button, where there is no room for all. A tool that opens a panel folds them again.
 * @param {HTMLElement} button @param {HTMLElement} tools */
function installFold(button, tools) {
  const fold = (/** @type {boolean} */ isOpen) => button.setAttribute("aria-expanded", String(isOpen));
  button.addEventListener("click", () => fold(button.getAttribute("aria-expanded") !== "true"));
  tools.addEventListener("click", (event) => {
    const pressed = /** @type {HTMLElement} */ (event.target).closest("button");
    if (pressed !== button && pressed?.getAttribute("aria-pressed") === "true" && pressed.id !== "fit") fold(false);
  });
}
