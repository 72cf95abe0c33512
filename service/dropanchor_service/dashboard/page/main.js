/** Connect the parts: the stream fills the fleet; map, table and panel show it. */

import { Alerts } from "../alerts/alerts.js";
import { Back } from "./back.js";
import { Basemap } from "../basemap/basemap.js";
import { OnlyChip } from "../panel/only_chip.js";
import { Alarms } from "../alarms/alarms.js";
import { Choice } from "./choice.js";
import { StateChips } from "../panel/chips.js";
import { Columns } from "../panel/columns.js";
import { chosenSite, Connection } from "../data/connection.js";
import { Detail } from "../panel/detail.js";
import { EdgeHints } from "../map/edge_hints.js";
import { Evidence } from "../data/evidence.js";
import { FirstHour } from "../panel/first_hour.js";
import { Finding } from "./finding.js";
import { Fleet } from "../data/fleet.js";
import { length, place } from "../data/format.js";
import { t } from "../i18n/language.js";
import { translate } from "../i18n/document.js";
import { listen } from "../map/gestures.js";
import { guideTo, leadTo } from "./guide.js";
import { installKeyboard } from "./keyboard.js";
import { Impaired } from "../panel/impaired.js";
import { Kiosk, kioskAddress } from "./kiosk.js";
import { LiveMap } from "../map/map.js";
import { Measure } from "../map/measure.js";
import { Plans } from "../plan/plans.js";
import { Notices } from "../panel/notices.js";
import { Notifications } from "./notifications.js";
import { Panels } from "./one_panel.js";
import { Past } from "./past.js";
import { cornersOf } from "../plan/transform.js";
import { Roster } from "../data/roster.js";
import { shareToken } from "../data/shared.js";
import { confirmed } from "../setup/confirm.js";
import { Setup } from "../setup/setup.js";
import { KeyPanel } from "./key_panel.js";
import { installRoom } from "./room.js";
import { installSections } from "./sections.js";
import { SharePanel } from "./share_panel.js";
import { TrailPanel } from "./trail_panel.js";
import { TagTable } from "../panel/table.js";
import { installDialog, installLanguages, installUnitChoice, showChoices } from "./display.js";
import { installTheme } from "./theme.js";
import { Trails } from "../data/trails.js";
import { ViewAddress } from "./view_address.js";
import { Zones } from "../zones/zones.js";
import { installZoneChoice } from "./zone_choice.js";
import { byId } from "./parts.js";

const PANELS_MS = 250;

translate(document);

const panels = new Panels(() => confirmed(/** @type {HTMLDialogElement} */ (byId("confirm")), t("panels.question"), t("panels.discard")));
const fleet = new Fleet();
const trails = new Trails();
const roster = new Roster(fleet);
/** @type {Choice} */
const choice = new Choice({ care: (tag) => roster.needsCare(tag), alarms: (tag) => alarms.rank(tag) > 0 }, (tag) => zones.zonesOf(tag));
const connection = new Connection();
const evidence = new Evidence();
const map = new LiveMap(byId("map"), byId("tools"), fleet, trails, roster, choice, evidence);
const chips = new StateChips(byId("chips"), fleet, choice);
const care = new OnlyChip(byId("care"), "care", () => roster.careCount, choice);
const troubled = new OnlyChip(byId("only-alarms"), "alarms", () => alarms.count, choice);
const detail = new Detail(byId("detail"), fleet, roster, choice, evidence);
const setup = new Setup(map, fleet, roster, choice, connection, panels);
detail.changes = setup.changes;
detail.leave = () => select(null);
const plans = new Plans(map, connection, setup.changes, panels);
const basemap = new Basemap(map, connection, byId("basemap"), byId("attribution"));
const notices = new Notices(connection, fleet);
const columns = new Columns(fleet);
columns.offer(byId("columns"));
map.layers.offer(byId("layers"));
const table = new TagTable(byId("table"), byId("count"), fleet, choice, columns, (tags, pick) => finding.pick(tags, pick));

table.isElsewhere = (/** @type {number} */ row) => map.isElsewhere(row);
const edges = new EdgeHints(byId("edges"), map);
const measure = new Measure(map, byId("measure"), byId("measured"), panels);
map.pressed = (/** @type {number} */ px, /** @type {number} */ py) => measure.press(px, py) || zones.press(px, py);
const past = new Past({ fleet, trails, roster, evidence, map, choice, connection, changes: setup.changes, panels, updatePanels, byId });
detail.heights.floors = () => plans.floors.all;
detail.heightsInPast = (/** @type {string} */ tag) => past.heightsOf(tag);
const zones = new Zones(map, connection, setup.changes, (tag) => fleet.row(tag) >= 0 && select(tag), panels);
zones.follow(past);
columns.about = { zonesOf: (/** @type {string} */ tag) => zones.zonesOf(tag), batteryOf: (/** @type {string} */ tag) => roster.of(tag)?.health?.battery_fraction ?? NaN };
zones.store.wantsNames = () => columns.isShown("zone") || choice.asksFor("zone");
const finding = new Finding({ map, fleet, roster, choice, table, setup, plans, zones, measure, past, panels, select, pickAll, byId });
const alarms = new Alarms(map, connection, setup.changes, choice, zones);
table.alarmOf = (/** @type {string} */ tag) => alarms.rank(tag);
notices.alarms = () => alarms.count;
notices.firstHour = new FirstHour(byId("empty"), setup.changes);
notices.firstHour.done = () => ({ anchor: map.anchors.length > 0, plan: plans.store.plans.length > 0, tag: fleet.size > 0, told: alerts.store.states.length > 0 });
const alerts = new Alerts(byId("alerts"), byId("confirm"), connection, zones, setup.changes, panels);

/** Show the details of a tag; null: leave them. @param {string | null} tag @param {() => void} [then] */
function pick(tag, then = () => {}) {
  if (tag === null) return panels.close(choice.several.length > 0 ? "several" : "tag");
  if (tag === choice.selected) return then();
  return panels.open("tag", () => {
    choice.select(tag);
    then();
  });
}

/** Select one tag with its details, several without, or none. @param {readonly string[]} tags @param {boolean} [gathering] */
function pickAll(tags, gathering = false) {
  const { follow } = choice;
  if (tags.length > 1 || gathering) {
    panels.open("several", () => {
      choice.selectAll(tags, gathering);
      choice.follow = follow;
    });
  } else pick(tags[0] ?? null);
}

/** @param {string | null} tag @param {() => void} [then] is done once it is selected, which may take an answer to a question */
function select(tag, then = () => {}) {
  pick(tag, () => {
    reveal(/** @type {string} */ (tag));
    then();
  });
}

/** Bring a tag into view, and announce it. @param {string} tag */
function reveal(tag) {
  map.reveal(fleet.row(tag));
  table.reveal(tag);
  byId("detail").scrollIntoView({ block: "nearest" });
  announce(tag);
}

/** The plots make the panel taller. Scroll the table once, so that the row of the tag stays visible. */
let revealedFor = /** @type {string | null} */ (null);
evidence.addEventListener("change", () => {
  if (choice.selected !== null && choice.selected !== revealedFor) table.scrollTo(choice.selected);
  revealedFor = choice.selected;
});

/** Announce the selection to screen readers. @param {string} tag */
function announce(tag) {
  const row = fleet.row(tag);
  const { x, y } = fleet.number;
  byId("spoken").textContent = t("tag.announced", {
    tag: fleet.labels[row], state: fleet.style(row).label, x: length(x[row], 1), y: length(y[row], 1),
  });
}

/** @param {(frame: import("../data/fleet.js").Frame, now_ms: number) => void} update @returns {(event: Event) => void} */
function receiver(update) {
  return (event) => {
    if (past.active) return;
    const now_ms = performance.now();
    const frame = /** @type {CustomEvent} */ (event).detail;
    const membership = fleet.membership;
    update(frame, now_ms);
    trails.note(fleet, frame.tags, now_ms);
    if (membership === fleet.membership) map.redraw();
    else updatePanels();
  };
}

connection.addEventListener("snapshot", receiver((frame, now_ms) => {
  fleet.replace(frame, now_ms);
  trails.prune(fleet);
  connection.slowDownFor(fleet.size);
}));
connection.addEventListener("change", receiver((frame, now_ms) => fleet.apply(frame, now_ms)));
connection.addEventListener("settings", () => roster.refresh());
roster.addEventListener("removed", () => connection.retry());
connection.addEventListener("status", () => {
  if (connection.status === "live" || past.active) return;
  fleet.current = false;
  byId("spoken").textContent = "";
  updatePanels();
});
connection.addEventListener("site", (event) => {
  const site = /** @type {CustomEvent} */ (event).detail;
  setup.setSite(site);
  measure.rotation_rad = detail.rotation_rad = site.georeference?.rotation_rad ?? 0;
  past.figures.georeferenced = site.georeference !== null;
  finding.georeference = site.georeference;
  byId("site").textContent = site.name || site.id;
});

/** Update the panels. A few times a second is enough, also without new poses, since ages grow. */
function updatePanels() {
  if (document.hidden) return;
  table.update();
  chips.update();
  care.update();
  troubled.update();
  alarms.update();
  detail.update();
  finding.update();
  past.update();
  setup.update();
  notices.update();
  address.update();
  back.update();
  edges.update();
  byId("crowd").hidden = !map.stats.density;
  map.redraw();
}

const filter = byId("filter");
filter.addEventListener("input", () => (choice.text = /** @type {HTMLInputElement} */ (filter).value));
byId("show-all").addEventListener("click", () => {
  /** @type {HTMLInputElement} */ (filter).value = "";
  choice.showAll();
});
choice.addEventListener("change", () => (byId("show-all").hidden = !choice.isFiltered));
byId("zoom-in").addEventListener("click", () => map.zoom(1.6));
byId("zoom-out").addEventListener("click", () => map.zoom(1 / 1.6));
byId("fit").addEventListener("click", () => map.fitAll());
map.addEventListener("view", () => byId("fit").setAttribute("aria-pressed", String(map.autoFit)));
map.canvas.addEventListener("pointermove", ({ offsetX, offsetY }) => {
  byId("cursor").textContent = place(map.view.worldX(offsetX), map.view.worldY(offsetY), 2);
});
document.addEventListener("keydown", (event) => {
  if (document.querySelector("dialog[open]")) return;
  if (event.key === "Escape" && measure.active) measure.turn(false);
  else if (event.key === "Escape") select(null);
});

showChoices();
const back = new Back(panels);
const address = new ViewAddress(choice, map, /** @type {HTMLInputElement} */ (byId("filter")), pickAll);
new Notifications(byId("notifications"), zones.log, (event) => zones.pick(event));
new Kiosk({
  tags: { names: () => table.shown, show: (tag) => select(tag) },
  floors: { names: () => plans.floors.all.map(({ name }) => name), show: (name) => plans.floors.choose(name) },
});
listen(map, (row, isAlso) => finding.pickOnMap(row, isAlso));
installTheme(byId("theme"), () => map.recolour());
installDialog(byId("options"), /** @type {HTMLDialogElement} */ (byId("display")), panels, "display");
installDialog(byId("share-with"), /** @type {HTMLDialogElement} */ (byId("sharing")), panels, "sharing");
const keys = /** @type {HTMLDialogElement} */ (byId("keys"));
const showKeys = () => {
  leadTo(byId("guide"), guideTo(panels.states, document.querySelector("#zones > details[open]") !== null));
  keys.showModal();
};
installDialog(byId("show-keys"), keys, panels, "keys", showKeys);
const trail = new TrailPanel(/** @type {HTMLDialogElement} */ (byId("trail")), setup.changes);
byId("trail-entry").hidden = shareToken !== null;
installDialog(byId("show-trail"), trail.dialog, panels, "trail", () => trail.open());
installKeyboard(keys, filter, () => panels.open("keys", showKeys));
installSections(document, panels);
installRoom(byId);
const share = new SharePanel(byId("share"), choice);
const accessKeys = new KeyPanel(byId("access-keys"));
byId("options").addEventListener("click", () => (/** @type {HTMLAnchorElement} */ (byId("kiosk-link")).href = kioskAddress(location)));
byId("share-with").addEventListener("click", () => {
  byId("link").textContent = location.href;
  share.open();
  accessKeys.open();
});
installLanguages(/** @type {HTMLSelectElement} */ (byId("language")));
for (const kind of /** @type {const} */ (["length", "velocity"])) installUnitChoice(/** @type {HTMLSelectElement} */ (byId(kind)), kind);
if (chosenSite !== null) import("./site_chooser.js").then(({ installSites }) => installSites(byId("sites"), byId("site")));
setInterval(updatePanels, PANELS_MS);
connection.start();
roster.start();
new Impaired(byId("impaired")).start();
installZoneChoice(connection, setup.changes);
connection.addEventListener("snapshot", () => past.start(), { once: true });

/** Read-only access for tests and for the console. */
Object.defineProperty(window, "dropanchor", {
  value: Object.freeze({
    status: () => connection.status,
    panels: () => panels.states,
    streaming: () => ({ ...connection.stats }),
    past: () => past.active && { time_ms: past.replay.time_ms, playing: past.replay.playing, loading: past.replay.loading },
    trail: (/** @type {string} */ tag) => {
      const trail = map.trails.of(tag);
      return Array.from({ length: trail?.length ?? 0 }, (_, i) => /** @type {any} */ (trail).x[/** @type {any} */ (trail).at(i)]);
    },
    events: () => zones.log.current,
    alarms: () => ({ pending: alarms.count, tags: Object.fromEntries(alarms.store.tags), sounds: alarms.sound.played }),
    destinations: () => alerts.store.states.map(({ destination, pending, dead }) => ({ id: destination.id, pending, dead })),
    zones: () => Object.fromEntries(zones.store.zones.map(({ id }) => [id, zones.store.inside.get(id) ?? 0])),
    draft: () => plans.editor.draft && { ...plans.editor.draft, corners: cornersOf(plans.editor.draft.placement, plans.editor.draft.image).map(([x, y]) => [map.view.screenX(x), map.view.screenY(y)]) },
    plans: () => plans.store.plans.map((plan) => ({ id: plan.id, placement: plan.placement, isReady: plans.images.isReady(plan.image) })),
    screen: (/** @type {number} */ x, /** @type {number} */ y) => [map.view.screenX(x), map.view.screenY(y)],
    basemap: () => basemap.stats,
    drawing: () => ({ ...map.stats, still: map.still }),
    anchors: () => map.anchors.map((anchor) => ({ ...anchor, pixel: [map.view.screenX(anchor.x), map.view.screenY(anchor.y)] })),
    tags: () => fleet.names.map((tag, row) => ({
      tag,
      label: fleet.labels[row],
      state: fleet.style(row).name,
      x: fleet.number.x[row],
      y: fleet.number.y[row],
      pixel: [map.view.screenX(fleet.drawnX[row]), map.view.screenY(fleet.drawnY[row])],
      semiMajor: fleet.number.semi_major_m[row],
    })),
  }),
});
