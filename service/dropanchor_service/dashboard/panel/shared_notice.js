/** Say that the page was opened with a share link: what it shows, until when, and clearly when it has ended. */

import { isLimited, shareClaims, shareToken } from "../data/shared.js";
import { t, timeText } from "../i18n/language.js";
import { byId } from "../page/parts.js";

/** @param {number} unix_s */
const dateText = (unix_s) => timeText(unix_s * 1000, { dateStyle: "medium", timeStyle: "short" });

export class SharedNotice {
  constructor() {
    if (isLimited) document.body.dataset.shared = "limited";
    if (!shareClaims) return;
    const { tag, group, exp } = shareClaims;
    const key = tag !== null ? "shared.tag" : group !== null ? "shared.group" : "shared.all";
    byId("shared").textContent = t(key, { tag: tag ?? "", group: group ?? "", time: dateText(exp) });
  }

  /** @param {boolean} locked whether the service refuses the link */
  update(locked) {
    byId("shared").hidden = shareClaims === null || locked;
    byId("ended").hidden = shareToken === null || !locked;
    if (!locked) return;
    const expired_s = shareClaims !== null && shareClaims.exp * 1000 <= Date.now() ? shareClaims.exp : null;
    const text = expired_s !== null ? t("shared.expired", { time: dateText(expired_s) }) : t("shared.revoked");
    if (byId("ended-why").textContent !== text) byId("ended-why").textContent = text;
  }
}
