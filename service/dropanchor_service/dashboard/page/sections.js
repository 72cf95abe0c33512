/** The lists of events, zones and alerts, one of which is open: a form in them is left like any other panel. */

/** @param {Document} page @param {import("./one_panel.js").Panels} panels */
export function installSections(page, panels) {
  for (const section of /** @type {NodeListOf<HTMLDetailsElement>} */ (page.querySelectorAll("#zones > details"))) {
    section.querySelector("summary")?.addEventListener("click", (event) => {
      event.preventDefault();
      panels.free("lists", () => (section.open = !section.open));
    });
  }
}
