/** The page of a tag: a form for the key, one button, and what happens to the samples. */

import { OUT_OF_DATE, STATES } from "../data/states.js";
import { count, fixed, UNKNOWN } from "../data/format.js";
import { translate } from "../i18n/document.js";
import { t } from "../i18n/language.js";
import { said } from "../i18n/said.js";
import { installLanguages } from "../page/display.js";
import { installTheme } from "../page/theme.js";
import { hasBluetooth } from "./bluetooth.js";
import { remember, remembered, takeFromAddress } from "./link.js";
import { phyphoxCode, phyphoxLink } from "./phyphox.js";
import { hasSerial } from "./serial.js";
import { ThisTag } from "./tag.js";
import { byId, instead } from "../page/parts.js";

const SHOW_MS = 250;

let tag = /** @type {ThisTag | null} */ (null);

/** @param {string} id @param {string} text */
function write(id, text) {
  const element = byId(id);
  if (element.textContent !== text) element.textContent = text;
}

/** @param {ThisTag} tag */
function offset(tag) {
  const best = tag.clock.best;
  if (best === null) return UNKNOWN;
  const values = { offset: fixed(best.offset_us / 1000, 0), half: fixed(best.half_us / 1000, 0) };
  return t(tag.clock.correction_us ? "phone.offset_corrected" : "phone.offset_value", values);
}

/** The tracking state of the last answer; undefined before the first pose. @param {ThisTag} tag */
function stateOf({ uplink }) {
  const state = STATES.find(({ name }) => name === uplink.answer?.state);
  return state && uplink.status !== "open" ? OUT_OF_DATE : state;
}

/** The sentences that the person should read now, the most urgent first. @param {ThisTag} tag */
function* problems(tag) {
  const { uplink, motion, queue } = tag;
  const { problem } = uplink;
  if (uplink.status === "refused") yield problem;
  if (uplink.status === "broken") yield t("phone.later", { problem }).trim();
  if (uplink.status === "open" && problem) yield problem;
  if (motion.problem) yield motion.problem;
  if (queue.lost) yield t("phone.queue_full");
  if (tag.running && !tag.awake) yield t("phone.screen_off");
}

/** @param {ThisTag} tag */
function show(tag) {
  const { uplink, motion, queue } = tag;
  const state = stateOf(tag);
  byId("status").dataset.status = { open: "live", broken: "lost", refused: "lost" }[String(uplink.status)] ?? "connecting";
  write("status-text", t(`phone.${uplink.status}`));
  write("toggle", t(tag.running ? "phone.stop" : "phone.start"));
  byId("toggle").classList.toggle("on", tag.running);
  write("rate", tag.running ? fixed(motion.rate_hz, 0) : UNKNOWN);
  write("screen", motion.screen ? t(`phone.${motion.screen}`) : UNKNOWN);
  write("sent", count(uplink.sent));
  write("waiting", count(queue.samples));
  write("lost", count(queue.lost));
  write("offset", offset(tag));
  byId("pose").dataset.state = state?.name ?? "initialising";
  write("state", state?.label ?? (uplink.answer === null ? UNKNOWN : t("phone.no_position")));
  write("hint", (uplink.status === "open" && uplink.answer && said(uplink.answer.hint, uplink.answer.hint_phrase)) || state?.meaning || t("phone.motion_alone"));
  const [first, ...others] = problems(tag);
  byId("problem").hidden = first === undefined;
  write("problem", [first, ...others].join(" "));
  byId("change").hidden = tag.running && uplink.status !== "refused";
  showModule(tag);
}

/** @param {ThisTag} tag */
function showModule({ serial, bluetooth }) {
  const connected = serial.connected || bluetooth.connected;
  const [ranges, damaged] = [serial.ranges + bluetooth.ranges, serial.damaged + bluetooth.damaged];
  byId("usb").hidden = connected || !hasSerial();
  byId("bluetooth").hidden = connected || !hasBluetooth();
  write("ranges", connected || ranges || damaged ? t(damaged ? "phone.ranges_damaged" : "phone.ranges", { ranges, damaged }) : "");
  write("module-problem", [serial.problem, bluetooth.problem].filter(Boolean).join(" "));
}

/** Why no module can be connected here; null where one can. */
function moduleRefusal() {
  if (!isSecureContext) return t("phone.https_module");
  if (hasSerial() || hasBluetooth()) return null;
  return t("phone.no_module");
}

/** @param {string} name @param {string} key */
async function open(name, key) {
  tag = await ThisTag.open(name, key);
  write("name", name);
  byId("form").hidden = true;
  byId("live").hidden = false;
  const refusal = moduleRefusal();
  byId("modules").hidden = refusal !== null;
  if (refusal !== null) write("module-hint", refusal);
  byId("phyphox").addEventListener("toggle", () => showPhyphox(name, key));
  show(tag);
}

/** @param {string} name @param {string} key */
async function showPhyphox(name, key) {
  /** @type {HTMLAnchorElement} */ (byId("phyphox-link")).href = phyphoxLink(name, key);
  const code = /** @type {HTMLImageElement} */ (byId("phyphox-code"));
  try {
    code.src = await phyphoxCode(name, key);
    code.hidden = false;
    write("phyphox-problem", "");
  } catch (error) {
    write("phyphox-problem", t("phone.no_code", { message: /** @type {Error} */ (error).message }));
  }
}

function ask() {
  byId("live").hidden = true;
  byId("form").hidden = false;
  /** @type {HTMLInputElement} */ (byId("tag")).value = remembered()?.tag ?? "";
}

instead(byId("form"), "submit", () => {
  const { tag, key } = /** @type {Record<string, HTMLInputElement>} */ (/** @type {unknown} */ (byId("form")));
  remember(tag.value.trim(), key.value.trim());
  location.reload(); // the old key's connection and sensors end with the old page
});
byId("toggle").addEventListener("click", () => (tag?.running ? tag.stop() : tag?.start()));
byId("usb").addEventListener("click", () => tag?.serial.connect());
byId("bluetooth").addEventListener("click", () => tag?.bluetooth.connect());
byId("change").addEventListener("click", async () => {
  await tag?.stop();
  ask();
});
addEventListener("hashchange", () => location.reload());

translate(document);
installLanguages(/** @type {HTMLSelectElement} */ (byId("language")));
installTheme(byId("theme"), () => undefined);
takeFromAddress();
const known = remembered();
if (known === null) ask();
else await open(known.tag, known.key);
setInterval(() => tag && show(tag), SHOW_MS);

/** Read-only access for tests and for the console. */
Object.defineProperty(window, "dropanchor", {
  value: Object.freeze({
    status: () => tag?.uplink.status ?? "closed",
    counts: () => tag && { taken: tag.taken, sent: tag.uplink.sent, waiting: tag.queue.samples, lost: tag.queue.lost },
  }),
});
