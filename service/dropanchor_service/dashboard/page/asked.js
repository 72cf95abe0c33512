/** Notice that a person asks what can be done at a place: right-click, long press, context-menu key or Shift + F10. */

const HOLD_MS = 500;
const STILL_PX = 10;

/** @typedef {{clientX: number, clientY: number, target: EventTarget | null}} Place */

/** @param {HTMLElement} element @param {(at: Place) => void} ask @param {() => void} askByKey */
export function listenForQuestions(element, ask, askByKey) {
  element.addEventListener("contextmenu", (event) => {
    event.preventDefault();
    ask(event);
  });
  element.addEventListener("keydown", (event) => {
    if (event.key !== "ContextMenu" && !(event.key === "F10" && event.shiftKey)) return;
    event.preventDefault();
    askByKey();
  });
  listenForHold(element, ask);
}

/** Not every browser sends a `contextmenu` event for a long press. @param {HTMLElement} element @param {(at: Place) => void} ask */
function listenForHold(element, ask) {
  let timer = 0;
  let [x, y] = [0, 0];
  let wasHeld = false;
  const stop = () => clearTimeout(timer);
  element.addEventListener("pointerdown", (event) => {
    stop();
    wasHeld = false;
    if (event.pointerType !== "touch" || !event.isPrimary) return;
    const { clientX, clientY, target, pointerId } = event;
    [x, y] = [clientX, clientY];
    timer = setTimeout(() => {
      wasHeld = true;
      target?.dispatchEvent(new PointerEvent("pointercancel", { pointerId, bubbles: true })); // the press is no tap any more
      ask({ clientX, clientY, target });
    }, HOLD_MS);
  });
  element.addEventListener("pointermove", ({ clientX, clientY }) => Math.hypot(clientX - x, clientY - y) > STILL_PX && stop());
  element.addEventListener("click", (event) => {
    if (wasHeld) event.stopPropagation();
    wasHeld = false; // a click by key is none of that press
  }, { capture: true });
  for (const name of ["pointerup", "pointercancel", "contextmenu"]) element.addEventListener(name, stop);
}
