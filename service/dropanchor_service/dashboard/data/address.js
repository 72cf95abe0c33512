/** The values in the address of the page: those after `#`, which no server sees, and before them those after `?`. */

/** The hash that the page shows or wrote last. A link that a person follows changes the hash before the page hears of it. */
let known = globalThis.location?.hash ?? "";

export const isAddressRead = () => location.hash === known;

/** Return the values that the page shows from now on. */
export function readAddress() {
  known = location.hash;
  return addressValues();
}

/** Return the values; of two with one name the one after `#` comes last. */
export function addressValues() {
  const { search = "", hash = "" } = globalThis.location ?? {};
  return new URLSearchParams([...new URLSearchParams(search), ...new URLSearchParams(hash.slice(1))]);
}

/** Return the names in a list of the address. @param {string} text */
export const listIn = (text) => text.split(",").filter((name) => name !== "").map(unescaped);

/** Return names as a list for the address. A comma in a name stays part of it. @param {readonly string[]} names */
export const listText = (names) => names.map((name) => encodeURIComponent(name)).join(",");

/** @param {string} name */
function unescaped(name) {
  try {
    return decodeURIComponent(name);
  } catch {
    return name; // typed by hand
  }
}

/** Return the hash with other values; null removes one. @param {string} hash @param {Record<string, string | null>} values */
export function hashWith(hash, values) {
  const all = new URLSearchParams(hash.replace(/^#/, ""));
  for (const [name, value] of Object.entries(values)) {
    if (value === null) all.delete(name);
    else all.set(name, value);
  }
  const text = all.toString().replaceAll("%3A", ":").replaceAll("%2C", ",");
  return text === "" ? "" : `#${text}`;
}

/** Write what the page shows into the entry of the history that it went to, instead of what that entry said. */
export function keepAddress() {
  if (!isAddressRead()) history.replaceState(history.state, "", known || location.pathname + location.search);
}

/** Write values after the `#`, without a new entry in the history of the browser. @param {Record<string, string | null>} values */
export function writeAddress(values) {
  const [hash, isRead] = [hashWith(location.hash, values), isAddressRead()];
  if (hash !== location.hash) history.replaceState(history.state, "", hash || location.pathname + location.search);
  if (isRead) known = location.hash;
}
