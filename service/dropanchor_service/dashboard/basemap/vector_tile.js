/** Read a vector tile (Mapbox Vector Tile 2.1, https://github.com/mapbox/vector-tile-spec): layers, features and lines. */

export const LINE = 2;
export const POLYGON = 3;

/** Names of the property that says what a feature is: in tiles of Protomaps and Shortbread, and of OpenMapTiles. */
const KIND_KEYS = ["kind", "class", "pmap:kind"];
const DEFAULT_EXTENT = 4096;
const [MOVE_TO, LINE_TO, CLOSE_PATH] = [1, 2, 7];
const [VARINT, FIXED_64, BYTES, FIXED_32] = [0, 1, 2, 5];
const decoder = new TextDecoder();

/** @typedef {{moveTo(x: number, y: number): void, lineTo(x: number, y: number): void, closePath(): void}} Pen */
/** @typedef {{layer: string, extent: number, type: number, kind: string, geometry: Uint8Array}} Feature kind: empty if it has none */

/** Yield the features of a tile. Throws RangeError for a tile that ends too early, and Error for one that is none.
 * @param {Uint8Array} tile @returns {Generator<Feature>} */
export function* featuresOf(tile) {
  for (const [number, layer] of fieldsOf(tile)) if (number === 3) yield* featuresOfLayer(bytesIn(layer));
}

/** @param {Uint8Array} content @returns {Generator<Feature>} */
function* featuresOfLayer(content) {
  const features = [];
  const [keys, values] = /** @type {[string[], string[]]} */ ([[], []]);
  let [layer, extent] = ["", DEFAULT_EXTENT];
  for (const [number, value] of fieldsOf(content)) {
    if (number === 1) layer = decoder.decode(bytesIn(value));
    else if (number === 2) features.push(bytesIn(value));
    else if (number === 3) keys.push(decoder.decode(bytesIn(value)));
    else if (number === 4) values.push(textIn(bytesIn(value)));
    else if (number === 5) extent = Number(value);
  }
  for (const feature of features) yield { layer, extent, ...featureIn(feature, keys, values) };
}

/** @param {Uint8Array} content @param {string[]} keys @param {string[]} values */
function featureIn(content, keys, values) {
  let [type, kind, geometry] = /** @type {[number, string, Uint8Array]} */ ([0, "", new Uint8Array()]);
  for (const [number, value] of fieldsOf(content)) {
    if (number === 2) kind = kindIn(bytesIn(value), keys, values);
    else if (number === 3) type = Number(value);
    else if (number === 4) geometry = bytesIn(value);
  }
  return { type, kind, geometry };
}

/** @param {Uint8Array} tags @param {string[]} keys @param {string[]} values */
function kindIn(tags, keys, values) {
  const reader = new Reader(tags);
  while (!reader.atEnd) {
    const [key, value] = [reader.varint(), reader.varint()];
    if (KIND_KEYS.includes(keys[key])) return values[value] ?? "";
  }
  return "";
}

/** Return a value that is a text; empty if it is another. @param {Uint8Array} content */
function textIn(content) {
  for (const [number, value] of fieldsOf(content)) if (number === 1) return decoder.decode(bytesIn(value));
  return "";
}

/** Draw the lines of a feature, with the tile from 0 to 1. @param {Pen} pen @param {Feature} feature */
export function trace(pen, { geometry, extent }) {
  const reader = new Reader(geometry);
  let [x, y] = [0, 0];
  while (!reader.atEnd) {
    const command = reader.varint();
    const [action, count] = [command & 7, command >>> 3];
    if (action === CLOSE_PATH) pen.closePath();
    else if (action !== MOVE_TO && action !== LINE_TO) throw new Error(`unknown command ${action} in a vector tile`);
    else for (let i = 0; i < count; i++) {
      x += signed(reader.varint());
      y += signed(reader.varint());
      if (action === MOVE_TO) pen.moveTo(x / extent, y / extent);
      else pen.lineTo(x / extent, y / extent);
    }
  }
}

/** @param {number} value in zigzag form */
const signed = (value) => (value >>> 1) ^ -(value & 1);

/** Yield number and value of each field of a message: bytes, or the value of a varint; 0 for other numbers.
 * @param {Uint8Array} message @returns {Generator<[number, Uint8Array | number]>} */
function* fieldsOf(message) {
  const reader = new Reader(message);
  while (!reader.atEnd) {
    const head = reader.varint();
    const kind = head & 7;
    if (kind === VARINT) yield [head >>> 3, reader.varint()];
    else if (kind === BYTES) yield [head >>> 3, reader.bytes(reader.varint())];
    else if (kind === FIXED_64 || kind === FIXED_32) yield [head >>> 3, reader.bytes(kind === FIXED_64 ? 8 : 4) && 0];
    else throw new Error("not a vector tile");
  }
}

/** @param {Uint8Array | number} value */
function bytesIn(value) {
  if (typeof value === "number") throw new Error("not a vector tile");
  return value;
}

class Reader {
  #at = 0;

  /** @param {Uint8Array} content */
  constructor(content) {
    this.content = content;
  }

  get atEnd() {
    return this.#at >= this.content.length;
  }

  /** Return a number, of which JavaScript keeps 53 bits. */
  varint() {
    let [value, factor] = [0, 1];
    for (;;) {
      const byte = this.content[this.#at++];
      if (byte === undefined || factor > 2 ** 63) throw new RangeError("a vector tile ends too early");
      value += (byte & 127) * factor;
      if (byte < 128) return value;
      factor *= 128;
    }
  }

  /** @param {number} length */
  bytes(length) {
    const end = this.#at + length;
    if (end > this.content.length) throw new RangeError("a vector tile ends too early");
    const found = this.content.subarray(this.#at, end);
    this.#at = end;
    return found;
  }
}
