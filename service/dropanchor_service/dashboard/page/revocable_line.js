/** A line of a list, with a button that revokes what it tells of. */

import { t } from "../i18n/language.js";
import { button, element, line } from "./elements.js";

/** @param {string} text of the line @param {string} what it tells of, for people who cannot see it @param {() => void} revoke */
export const revocableLine = (text, what, revoke) => line(element("span", text), button(t("share.revoke"), t("share.revoke_one", { what }), revoke));
