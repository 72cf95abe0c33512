/**
 * Ranges from the lines that a Decawave DWM1001 prints after `lec` or `les`.
 *
 * At high rates the firmware writes one line into another. A line counts only when all of it has the form it should
 * have: the number of anchors that it announces, each with its index, a hexadecimal id and numbers of two decimals.
 */

const MAX_LINE = 1024;
const MAX_RANGE_M = 1000;
const NUMBER = "-?\\d{1,4}\\.\\d{2}";
const ID = "[0-9A-F]{4}";
const LEC = /DIST,(\d{1,2})(?:,(.*))?$/;
const LEC_ANCHOR = new RegExp(`AN(\\d{1,2}),(${ID}),${NUMBER},${NUMBER},${NUMBER},(${NUMBER})(?:,|$)`, "y");
const LEC_END = new RegExp(`^(?:POS,${NUMBER},${NUMBER},${NUMBER},\\d{1,3})?$`);
const LES = new RegExp(`${ID}\\[.*$`);
const LES_ANCHOR = new RegExp(`(${ID})\\[${NUMBER},${NUMBER},${NUMBER}\\]=(${NUMBER})(?: |$)`, "y");
const LES_END = new RegExp(`^(?:le_us=\\d+ ?)?(?:est\\[${NUMBER},${NUMBER},${NUMBER},\\d{1,3}\\])?$`);

/** @typedef {{ anchor: string, range_m: number }} Range */

export class Dwm1001 {
  /** Lines that look like ranges but are damaged. */
  damaged = 0;
  #rest = "";

  /** Take text in pieces of any size. Return the ranges of the lines that it completes. @param {string} text @returns {Range[]} */
  feed(text) {
    const lines = (this.#rest + text).split(/[\r\n]+/);
    this.#rest = (lines.pop() ?? "").slice(-MAX_LINE);
    return lines.flatMap((line) => this.#ranges(line.trim()));
  }

  /** @param {string} line @returns {Range[]} */
  #ranges(line) {
    const lec = LEC.exec(line.slice(Math.max(0, line.lastIndexOf("DIST,"))));
    const les = LES.exec(line);
    if (lec === null && les === null) return [];
    const ranges = lec ? ofLec(Number(lec[1]), lec[2] ?? "") : ofLes(les?.[0] ?? "");
    if (ranges === null || new Set(ranges.map(({ anchor }) => anchor)).size !== ranges.length) {
      this.damaged++;
      return [];
    }
    return ranges.filter(({ range_m }) => range_m >= 0 && range_m <= MAX_RANGE_M);
  }
}

/** @param {number} count @param {string} text @returns {Range[] | null} null when the line is damaged */
function ofLec(count, text) {
  const { found, rest } = anchorsOf(LEC_ANCHOR, text);
  const numbered = found.every((match, i) => Number(match[1]) === i);
  if (found.length !== count || !numbered || !LEC_END.test(rest)) return null;
  return found.map((match) => ({ anchor: match[2], range_m: Number(match[3]) }));
}

/** @param {string} text @returns {Range[] | null} null when the line is damaged */
function ofLes(text) {
  const { found, rest } = anchorsOf(LES_ANCHOR, text);
  if (!found.length || !LES_END.test(rest)) return null;
  return found.map((match) => ({ anchor: match[1], range_m: Number(match[2]) }));
}

/** @param {RegExp} pattern sticky @param {string} text */
function anchorsOf(pattern, text) {
  const found = /** @type {RegExpExecArray[]} */ ([]);
  let end = 0;
  for (;;) {
    pattern.lastIndex = end;
    const match = pattern.exec(text);
    if (match === null) return { found, rest: text.slice(end) };
    found.push(match);
    end = pattern.lastIndex;
  }
}
