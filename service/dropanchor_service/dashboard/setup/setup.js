/** Connect what sets a site up: anchors, tags and groups. */

import { Changes } from "../data/changes.js";
import { AddAnchor } from "../panel/add_anchor.js";
import { AnchorEditor } from "./anchors.js";
import { AnchorPanel } from "./anchor_panel.js";
import { drawEditedAnchor, drawStart } from "./draw.js";
import { giveTo } from "./gestures.js";
import { GroupFilter } from "./group_filter.js";
import { Outcome } from "./outcome.js";
import { StartEditor } from "./start.js";
import { TagPanel } from "./tag_panel.js";
import { installUndoKeys } from "./undo_keys.js";
import { byId } from "../page/parts.js";

export class Setup {
  changes = new Changes();
  start = new StartEditor();

  /** @param {import("../map/map.js").LiveMap} map @param {import("../data/fleet.js").Fleet} fleet
   * @param {import("../data/roster.js").Roster} roster @param {import("../page/choice.js").Choice} choice
   * @param {import("../data/connection.js").Connection} connection @param {import("../page/one_panel.js").Panels} panels */
  constructor(map, fleet, roster, choice, connection, panels) {
    const { changes, start } = this;
    this.anchors = new AnchorEditor(map, changes);
    const dialog = /** @type {HTMLDialogElement} */ (byId("confirm"));
    this.anchorPanel = new AnchorPanel(byId("setup"), byId("edit"), dialog, this.anchors, changes, panels, fleet);
    this.tagPanel = new TagPanel(byId("detail"), dialog, fleet, choice, changes, start, panels);
    this.addAnchor = new AddAnchor(byId("detail"), roster, choice, changes, (id) => this.anchorPanel.add(id));
    this.groups = new GroupFilter(/** @type {HTMLSelectElement} */ (byId("group")), fleet, choice);
    new Outcome(byId("outcome"), changes);
    map.overlays.push(({ ctx, view, palette }) => {
      if (this.anchors.draft) drawEditedAnchor(ctx, view, palette, this.anchors.draft, this.anchors.origin);
      if (start.draft) drawStart(ctx, view, palette, start.draft);
    });
    giveTo(map, [start, this.anchors]);
    start.addEventListener("change", () => map.redraw());
    for (const name of ["done", "conflict"]) changes.addEventListener(name, () => connection.refresh());
    connection.addEventListener("status", () => connection.status === "live" && changes.requestAccess());
    installUndoKeys(changes);
    changes.history.addEventListener("undone", (event) => {
      const { started } = /** @type {CustomEvent} */ (event).detail;
      if (started) map.trails.forget(started.tag, started.since_ms);
    });
  }

  /** Take the site as it is now. @param {{anchors: import("../map/draw_site.js").Anchor[], georeference: {rotation_rad: number} | null}} site */
  setSite(site) {
    this.anchors.setAnchors(site.anchors);
    this.start.rotation_rad = site.georeference?.rotation_rad ?? 0;
  }

  update() {
    this.addAnchor.update();
    this.groups.update();
  }
}
