/** Long names in little room: the middle is left out, because names of one fleet mostly differ at the end. */

const HEAD_SHARE = 0.3;

/**
 * The name, or its begin and its end around an ellipsis, as much of it as has room.
 * @param {string} name @param {number} room @param {(text: string) => number} widthOf
 */
export function shortened(name, room, widthOf) {
  if (widthOf(name) <= room) return name;
  const letters = [...name];
  let [least, most] = [1, letters.length - 1];
  while (least < most) {
    const middle = Math.ceil((least + most) / 2);
    if (widthOf(keeping(letters, middle)) <= room) least = middle;
    else most = middle - 1;
  }
  return keeping(letters, least);
}

/** @param {string[]} letters @param {number} count */
function keeping(letters, count) {
  const head = Math.floor(count * HEAD_SHARE);
  return `${letters.slice(0, head).join("")}…${letters.slice(letters.length - (count - head)).join("")}`;
}

/** Shortens names for the lines of one column, and remembers them until its width or its font is another. */
export class NameColumn {
  #pen = /** @type {CanvasRenderingContext2D} */ (document.createElement("canvas").getContext("2d"));
  #room = NaN;
  #font = "";
  /** @type {Map<string, string>} */
  #known = new Map();

  /** @param {HTMLElement} line one of the column @param {number} lines that a name may fill */
  measure(line, lines) {
    const { fontWeight, fontSize, fontFamily } = getComputedStyle(line);
    const font = `${fontWeight} ${fontSize} ${fontFamily}`;
    // Every line may end a letter early, and the widest ones are wider than the font is high.
    const room = lines * (line.clientWidth - parseFloat(fontSize));
    if (room === this.#room && font === this.#font) return;
    this.#room = room;
    this.#font = this.#pen.font = font;
    this.#known.clear();
  }

  /** @param {string} name */
  of(name) {
    let short = this.#known.get(name);
    if (short === undefined) {
      short = shortened(name, this.#room, (text) => this.#pen.measureText(text).width);
      this.#known.set(name, short);
    }
    return short;
  }
}
