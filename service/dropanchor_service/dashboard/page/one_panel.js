/** One panel at a time: opening a panel leaves those that need the same place, with a question only if something typed would be lost. */

/** @typedef {"side" | "map" | "lists" | "window" | "present"} Place details beside the map, presses on the map, the lists of events,
 * zones and alerts, a dialog over the page, and the present, which can be changed */
/** @typedef {{isOpen: () => boolean, leave: () => void, isUnsaved?: () => boolean, saving?: () => Promise<unknown> | null}} Panel
 * isUnsaved: something typed would be lost; saving: it is being saved now */
/** @typedef {keyof typeof PLACES} PanelName */

/** The places that each panel needs for itself. */
export const PLACES = {
  tag: ["side"],
  several: ["side"],
  start: ["map", "present"],
  anchors: ["side", "map", "present"],
  plans: ["side", "map", "present"],
  zone: ["side", "map", "lists", "present"],
  destination: ["side", "lists", "present"],
  rule: ["side", "lists", "present"],
  measure: ["map"],
  past: ["present"],
  heat: [],
  figures: ["window"],
  display: ["window"],
  sharing: ["window"],
  keys: ["window"],
  trail: ["window"],
};

export class Panels {
  /** @type {Map<PanelName, Panel>} */
  #all = new Map();
  /** What had the focus before a panel was opened. @type {Map<PanelName, HTMLElement | null>} */
  #from = new Map();

  /** @param {() => Promise<boolean>} mayDiscard asks whether what is typed may be lost */
  constructor(mayDiscard) {
    this.mayDiscard = mayDiscard;
  }

  /** @param {PanelName} name @param {Panel} panel */
  add(name, panel) {
    this.#all.set(name, panel);
  }

  /** Register a dialog, which keeps what is typed when it closes. @param {PanelName} name @param {HTMLDialogElement} dialog */
  addDialog(name, dialog) {
    this.add(name, { isOpen: () => dialog.open, leave: () => dialog.close() });
  }

  /** The names of all panels, and whether each is open. */
  get states() {
    return Object.fromEntries([...this.#all].map(([name, panel]) => [name, panel.isOpen()]));
  }

  /** Open a panel, or show something else in it. @param {PanelName} name @param {() => void} show */
  open(name, show) {
    const own = this.#get(name);
    const others = this.#openIn(PLACES[name]).filter((panel) => panel !== own);
    const from = own.isOpen() ? this.#from.get(name) : focused();
    this.#lose([own, ...others], () => {
      this.#from.set(name, from ?? null);
      this.#leave(others);
      show();
    });
  }

  /** Close a panel. If it takes the focus with it, what had that before gets it back. @param {PanelName} name */
  close(name) {
    const panel = this.#get(name);
    this.#lose([panel], () => {
      this.#leave([panel]);
      if (focused()?.getClientRects().length === 0) this.#from.get(name)?.focus();
    });
  }

  /** @param {PanelName} name @param {() => void} show */
  toggle(name, show) {
    if (this.#get(name).isOpen()) this.close(name);
    else this.open(name, show);
  }

  /** Leave what is open in a place, then do something. @param {Place} place @param {() => void} act */
  free(place, act) {
    const panels = this.#openIn([place]);
    this.#lose(panels, () => {
      this.#leave(panels);
      act();
    });
  }

  /** @param {PanelName} name */
  #get(name) {
    return /** @type {Panel} */ (this.#all.get(name));
  }

  /** @param {readonly string[]} places */
  #openIn(places) {
    return [...this.#all].filter(([name, panel]) => panel.isOpen() && PLACES[name].some((place) => places.includes(place))).map(([, panel]) => panel);
  }

  /** Act at once if nothing typed is lost by it, otherwise when it is saved or when a person agrees.
   * @param {Panel[]} panels @param {() => void} act */
  #lose(panels, act) {
    const saving = panels.find((panel) => panel.isOpen() && panel.saving?.())?.saving?.();
    if (saving) return void saving.catch(() => null).then(() => this.#lose(panels, act));
    if (!panels.some((panel) => panel.isOpen() && panel.isUnsaved?.())) act();
    else this.mayDiscard().then((may) => may && act());
  }

  /** @param {Panel[]} panels */
  #leave(panels) {
    for (const panel of panels) if (panel.isOpen()) panel.leave();
  }
}

const focused = () => /** @type {HTMLElement | null} */ (globalThis.document?.activeElement ?? null);
