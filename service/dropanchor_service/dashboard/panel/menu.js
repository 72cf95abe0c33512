/** A menu at a place of the page: arrow keys move in it, Enter chooses, Escape and a press beside it close it. */

/** @typedef {{label: string, act: () => void}} Item */

const MARGIN_PX = 8;

export class Menu {
  #before = /** @type {HTMLElement | null} */ (null);

  /** @param {HTMLElement} box @param {HTMLElement} title @param {HTMLElement} list */
  constructor(box, title, list) {
    this.box = box;
    this.title = title;
    this.list = list;
    box.addEventListener("keydown", (event) => this.#onKey(event));
    box.addEventListener("contextmenu", (event) => event.preventDefault());
    document.addEventListener("pointerdown", (event) => !box.contains(/** @type {Node} */ (event.target)) && this.close(), { capture: true });
    for (const name of ["resize", "blur"]) addEventListener(name, () => this.close());
  }

  /** @param {number} left px in the window @param {number} top @param {string} title @param {readonly Item[]} items */
  open(left, top, title, items) {
    if (!this.isOpen) this.#before = /** @type {HTMLElement | null} */ (document.activeElement);
    this.title.textContent = title;
    this.list.replaceChildren(...items.map((item) => this.#button(item)));
    this.box.hidden = false;
    const { offsetWidth, offsetHeight, style } = this.box;
    style.left = `${Math.max(MARGIN_PX, Math.min(left, innerWidth - offsetWidth - MARGIN_PX))}px`;
    style.top = `${Math.max(MARGIN_PX, Math.min(top, innerHeight - offsetHeight - MARGIN_PX))}px`;
    this.#focus(0);
  }

  get isOpen() {
    return !this.box.hidden;
  }

  /** Close the menu, and give the focus back if the menu has it. */
  close() {
    if (!this.isOpen) return;
    const hadFocus = this.box.contains(document.activeElement);
    this.box.hidden = true;
    if (hadFocus) this.#before?.focus();
  }

  /** @param {Item} item */
  #button({ label, act }) {
    const button = Object.assign(document.createElement("button"), { type: "button", role: "menuitem", tabIndex: -1, textContent: label });
    button.addEventListener("click", () => {
      this.close();
      act();
    });
    return button;
  }

  /** @param {number} place */
  #focus(place) {
    const buttons = /** @type {HTMLButtonElement[]} */ ([...this.list.children]);
    buttons.at(place % buttons.length)?.focus();
  }

  /** @param {KeyboardEvent} event */
  #onKey(event) {
    const at = [...this.list.children].indexOf(/** @type {Element} */ (document.activeElement));
    const places = { ArrowDown: at + 1, ArrowUp: at - 1, Home: 0, End: -1 };
    const place = places[/** @type {keyof typeof places} */ (event.key)];
    if (place !== undefined) this.#focus(place);
    else if (event.key === "Escape" || event.key === "Tab") this.close();
    else return;
    event.preventDefault();
    event.stopPropagation();
  }
}
