/** Shorten long names in the middle, because the names of one fleet mostly differ at the end. */

const HEAD_SHARE = 0.3;

/**
 * Return the name, or as much of its start and end as fits around an ellipsis.
 * @param {string} name @param {number} room available width @param {(text: string) => number} widthOf
 */
export function shortened(name, room, widthOf) {
  if (widthOf(name) <= room) return name;
  const letters = [...name];
  let [low, high] = [1, letters.length - 1];
  while (low < high) {
    const middle = Math.ceil((low + high) / 2);
    if (widthOf(withoutMiddle(letters, middle)) <= room) low = middle;
    else high = middle - 1;
  }
  return withoutMiddle(letters, low);
}

/** Return `count` letters from the start and the end, around an ellipsis. @param {string[]} letters @param {number} count */
function withoutMiddle(letters, count) {
  const head = Math.floor(count * HEAD_SHARE);
  return `${letters.slice(0, head).join("")}…${letters.slice(letters.length - (count - head)).join("")}`;
}

/** Shorten the names of one table column. Results are cached until its width or font changes. */
export class NameColumn {
  #pen = /** @type {CanvasRenderingContext2D} */ (document.createElement("canvas").getContext("2d"));
  #room = NaN;
  #font = "";
  /** @type {Map<string, string>} */
  #cache = new Map();

  /** @param {HTMLElement} line a name in the column @param {number} lines number of lines that a name may fill */
  measure(line, lines) {
    const { fontWeight, fontSize, fontFamily } = getComputedStyle(line);
    const font = `${fontWeight} ${fontSize} ${fontFamily}`;
    // Each line may break one letter early. The widest letters are wider than the font size.
    const room = lines * (line.clientWidth - parseFloat(fontSize));
    if (room === this.#room && font === this.#font) return;
    this.#room = room;
    this.#font = this.#pen.font = font;
    this.#cache.clear();
  }

  /** @param {string} name */
  of(name) {
    let short = this.#cache.get(name);
    if (short === undefined) {
      short = shortened(name, this.#room, (text) => this.#pen.measureText(text).width);
      this.#cache.set(name, short);
    }
    return short;
  }
}
