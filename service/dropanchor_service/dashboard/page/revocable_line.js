/** A line of a list, with a button that revokes what it tells of. */

import { t } from "../i18n/language.js";

/** @param {string} text of the line @param {string} what it tells of, for people who cannot see it @param {() => void} revoke */
export function revocableLine(text, what, revoke) {
  const line = document.createElement("li");
  const shown = Object.assign(document.createElement("span"), { textContent: text });
  const button = Object.assign(document.createElement("button"), { type: "button", className: "text", textContent: t("share.revoke") });
  button.setAttribute("aria-label", t("share.revoke_one", { what }));
  button.addEventListener("click", revoke);
  line.append(shown, button);
  return line;
}
