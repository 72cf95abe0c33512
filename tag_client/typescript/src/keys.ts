/** Zenoh keys and the numbers of anchors. */

const MAX_ID_LENGTH = 64;
const CONTROL = /[\p{Cc}\p{Cs}]/u;
const DECIMAL = /^(0|[1-9][0-9]{0,9})$/;
const ESCAPED_BY_US_ALONE = /[!'()*~]/g;

/** Return the key of a tag. Throws RangeError for an id that is empty, longer than 64 characters, `.` or `..`, or not printable. */
export function tagKey(site: string, tag: string, leaf: "samples" | "alive" | "pose"): string {
  return `dropanchor/@v1/${chunk(site)}/tag/${chunk(tag)}/${leaf}`;
}

/** Return the u32 that names an anchor in packed payloads. Throws RangeError for an empty id. */
export function anchorNumber(id: string): number {
  if (id === "") throw new RangeError("an anchor id is not empty");
  if (DECIMAL.test(id) && Number(id) < 2 ** 32) return Number(id);
  return crc32(new TextEncoder().encode(id));
}

function chunk(id: string): string {
  const length = [...id].length;
  if (length === 0 || length > MAX_ID_LENGTH) throw new RangeError(`an id has 1 to ${MAX_ID_LENGTH} characters`);
  if (id === "." || id === "..") throw new RangeError(`${id} cannot be an id`);
  if (CONTROL.test(id)) throw new RangeError("an id holds printable characters only");
  return encodeURIComponent(id).replace(ESCAPED_BY_US_ALONE, (c) => `%${c.charCodeAt(0).toString(16).toUpperCase()}`);
}

function crc32(bytes: Uint8Array): number {
  let crc = 0xffffffff;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; bit += 1) crc = (crc >>> 1) ^ (crc & 1 ? 0xedb88320 : 0);
  }
  return ~crc >>> 0;
}
