/** The page of a tag: a form for the key, one button, and what happens to the samples. */

import { OUT_OF_DATE, STATES } from "../data/states.js";
import { fixed, UNKNOWN } from "../data/format.js";
import { installTheme } from "../page/theme.js";
import { hasBluetooth } from "./bluetooth.js";
import { remember, remembered, takeFromAddress } from "./link.js";
import { phyphoxCode, phyphoxLink } from "./phyphox.js";
import { hasSerial } from "./serial.js";
import { ThisTag } from "./tag.js";

const SHOW_MS = 250;
const STATUS = {
  closed: "Not connected",
  connecting: "Connecting",
  open: "Connected",
  broken: "No connection",
  refused: "Refused",
};

/** @template {HTMLElement} T @param {string} id @returns {T} */
const byId = (id) => /** @type {T} */ (document.getElementById(id));

let tag = /** @type {ThisTag | null} */ (null);

/** @param {string} id @param {string} text */
function write(id, text) {
  const element = byId(id);
  if (element.textContent !== text) element.textContent = text;
}

/** @param {number} count */
const counted = (count) => count.toLocaleString("en");

/** @param {ThisTag} tag */
function offset(tag) {
  const best = tag.clock.best;
  if (best === null) return UNKNOWN;
  const sentence = `${fixed(best.offset_us / 1000, 0)} ms ± ${fixed(best.half_us / 1000, 0)}`;
  return tag.clock.correction_us ? `${sentence}, corrected` : sentence;
}

/** The tracking state of the last answer; undefined before the first pose. @param {ThisTag} tag */
function stateOf({ uplink }) {
  const state = STATES.find(({ name }) => name === uplink.answer?.state);
  return state && uplink.status !== "open" ? OUT_OF_DATE : state;
}

/** The sentences that the person should read now, the most urgent first. @param {ThisTag} tag */
function* problems(tag) {
  const { uplink, motion, queue } = tag;
  if (uplink.status === "refused") yield uplink.problem;
  if (uplink.status === "broken") yield `${uplink.problem} The samples wait on this device and are sent later.`.trim();
  if (uplink.status === "open" && uplink.problem) yield uplink.problem;
  if (motion.problem) yield motion.problem;
  if (queue.lost) yield "The queue on this device is full: its oldest samples were dropped.";
  if (tag.running && !tag.awake) yield "The screen may go off, and then the sensors stop: keep it on.";
}

/** @param {ThisTag} tag */
function show(tag) {
  const { uplink, motion, queue } = tag;
  const state = stateOf(tag);
  byId("status").dataset.status = { open: "live", broken: "lost", refused: "lost" }[String(uplink.status)] ?? "connecting";
  write("status-text", STATUS[uplink.status]);
  write("toggle", tag.running ? "Stop" : "Start");
  byId("toggle").classList.toggle("on", tag.running);
  write("rate", tag.running ? fixed(motion.rate_hz, 0) : UNKNOWN);
  write("screen", motion.screen || UNKNOWN);
  write("sent", counted(uplink.sent));
  write("waiting", counted(queue.samples));
  write("lost", counted(queue.lost));
  write("offset", offset(tag));
  byId("pose").dataset.state = state?.name ?? "initialising";
  write("state", state?.label ?? (uplink.answer === null ? UNKNOWN : "No position yet"));
  write("hint", (uplink.status === "open" && uplink.answer?.hint) || state?.meaning || "Motion alone gives no position: this tag needs ranges too.");
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
  write("ranges", connected || ranges || damaged ? `${counted(ranges)} ranges${damaged ? `, ${counted(damaged)} damaged` : ""}` : "");
  write("module-problem", [serial.problem, bluetooth.problem].filter(Boolean).join(" "));
}

/** Why no module can be connected here; null where one can. */
function moduleRefusal() {
  if (!isSecureContext) return "Browsers reach modules from pages over HTTPS only: open this page with https://.";
  if (hasSerial() || hasBluetooth()) return null;
  return "This browser reaches no UWB module: Firefox and Safari have neither Web Bluetooth nor Web Serial. Use Chrome or Edge.";
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
    write("phyphox-problem", `The code cannot be shown: ${/** @type {Error} */ (error).message}`);
  }
}

function ask() {
  byId("live").hidden = true;
  byId("form").hidden = false;
  /** @type {HTMLInputElement} */ (byId("tag")).value = remembered()?.tag ?? "";
}

byId("form").addEventListener("submit", (event) => {
  event.preventDefault();
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
