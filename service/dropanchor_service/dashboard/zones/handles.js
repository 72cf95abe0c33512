/** The handles of the edited zone: buttons over the map that pointers drag, arrow keys move and Delete removes. */

import { length } from "../data/format.js";
import { t } from "../i18n/language.js";
import { handlesOf, movedTo, withoutCorner } from "./shape_edit.js";
import { stepOf } from "../setup/gestures.js";

/** @typedef {import("./shape_edit.js").Handle} Handle */


export class Handles {
  /** @type {HTMLButtonElement[]} */
  #buttons = [];
  /** @type {Handle[]} */
  #handles = [];
  #grab = { dx: 0, dy: 0, moved: false };

  /** @param {HTMLElement} box over the map @param {import("../map/map.js").LiveMap} map @param {import("./editor.js").ZoneEditor} editor */
  constructor(box, map, editor) {
    this.box = box;
    this.map = map;
    this.editor = editor;
    this.mark = Object.assign(document.createElement("span"), { className: "mark", textContent: "!", hidden: true });
    box.append(this.mark);
    editor.addEventListener("change", () => this.#update());
  }

  /** Put every handle where its point is on the screen. The map calls this with every drawing. */
  place() {
    this.#handles.forEach(({ x, y }, i) => this.#put(this.#buttons[i], x, y));
    if (this.editor.problemAt) this.#put(this.mark, ...this.editor.problemAt);
  }

  /** Focus the last corner. */
  focusLast() {
    const corners = this.#handles.filter(({ kind }) => kind !== "edge").length;
    this.#buttons[corners - 1]?.focus();
  }

  /** @param {HTMLElement} element @param {number} x @param {number} y */
  #put(element, x, y) {
    const { view } = this.map;
    element.style.transform = `translate(${view.screenX(x).toFixed(1)}px, ${view.screenY(y).toFixed(1)}px)`;
  }

  #update() {
    const { zone, problemAt, drawing } = this.editor;
    this.#handles = zone ? handlesOf(zone.shape).filter(({ kind }) => kind !== "edge" || !drawing) : [];
    while (this.#buttons.length > this.#handles.length) this.#buttons.pop()?.remove();
    while (this.#buttons.length < this.#handles.length) this.#add();
    const corners = this.#handles.filter(({ kind }) => kind === "corner").length;
    this.#handles.forEach((handle, i) => this.#label(this.#buttons[i], handle, corners));
    this.mark.hidden = problemAt === null;
    this.box.hidden = zone === null;
    this.place();
    this.map.redraw();
  }

  /** @param {HTMLButtonElement} button @param {Handle} handle @param {number} corners */
  #label(button, { kind, index, x, y }, corners) {
    button.className = kind;
    button.setAttribute("aria-label", t(`handle.${kind}`, { number: index + 1, corners, x: length(x, 1), y: length(y, 1) }));
  }

  #add() {
    const button = document.createElement("button");
    const number = this.#buttons.length;
    button.type = "button";
    button.addEventListener("pointerdown", (event) => this.#press(number, event));
    button.addEventListener("pointermove", (event) => this.#drag(number, event));
    button.addEventListener("click", (event) => this.#click(number, event));
    button.addEventListener("keydown", (event) => this.#key(number, event));
    button.addEventListener("focus", () => this.#reveal(number));
    this.#buttons.push(button);
    this.box.append(button);
  }

  /** @param {number} number @param {PointerEvent} event */
  #press(number, event) {
    const { x, y } = this.#handles[number];
    const { view } = this.map;
    this.#buttons[number].setPointerCapture(event.pointerId);
    this.#grab = { dx: view.screenX(x) - event.clientX, dy: view.screenY(y) - event.clientY, moved: false };
    this.map.takeOver();
  }

  /** @param {number} number @param {PointerEvent} event */
  #drag(number, event) {
    if (!this.#buttons[number].hasPointerCapture(event.pointerId)) return;
    const { view } = this.map;
    this.#grab.moved = true;
    const [x, y] = [view.worldX(event.clientX + this.#grab.dx), view.worldY(event.clientY + this.#grab.dy)];
    this.#move(this.#cornerOf(number, event.pointerId), x, y, this.#grab);
  }

  /** Turn an edge into a corner when it is first dragged. Return the number of the handle that is being dragged.
   * @param {number} number @param {number} pointer */
  #cornerOf(number, pointer) {
    const { kind, index, x, y } = this.#handles[number];
    if (kind !== "edge") return number;
    this.#move(number, x, y, this.#grab);
    this.#buttons[index + 1].setPointerCapture(pointer);
    this.#buttons[index + 1].focus();
    return index + 1;
  }

  /** @param {number} number @param {number} x @param {number} y @param {object | string} [gesture] that moves it */
  #move(number, x, y, gesture) {
    const { zone } = this.editor;
    const handle = this.#handles[number];
    if (zone) this.editor.reshape(t(`handle.moved_${handle.kind}`), movedTo(zone.shape, handle, x, y), gesture);
  }

  /** A click on the first corner closes the polygon; one on an edge, also by keyboard, makes a corner there.
   * @param {number} number @param {MouseEvent} event */
  #click(number, event) {
    const { kind, index, x, y } = this.#handles[number];
    const isDrag = event.detail > 0 && this.#grab.moved;
    if (isDrag) return;
    if (kind === "corner" && index === 0 && this.editor.drawing) this.editor.stopDrawing();
    else if (kind === "edge") {
      this.#move(number, x, y);
      this.#buttons[index + 1].focus();
    }
  }

  /** @param {number} number @param {KeyboardEvent} event */
  #key(number, event) {
    const { kind, index, x, y } = this.#handles[number];
    const step = stepOf(event);
    if (step && kind !== "edge") this.#move(number, x + step[0], y + step[1], `arrows ${kind} ${index}`);
    else if (kind === "corner" && (event.key === "Delete" || event.key === "Backspace")) this.#remove(index);
    else return;
    event.preventDefault();
  }

  /** @param {number} index */
  #remove(index) {
    const { zone } = this.editor;
    if (!zone) return;
    this.editor.reshape(t("zone.corner_removed"), withoutCorner(zone.shape, index));
    this.#buttons[Math.max(0, index - 1)]?.focus();
  }

  /** Bring a handle that has the focus into view. @param {number} number */
  #reveal(number) {
    const { x, y } = this.#handles[number];
    const { view } = this.map;
    const seen = view.bounds(-12);
    if (x > seen.left && x < seen.right && y > seen.bottom && y < seen.top) return;
    this.map.takeOver();
    [view.x, view.y] = [x, y];
    this.map.redraw();
  }
}
