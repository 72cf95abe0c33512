/** The values in the address of the page: those after `#`, which no server sees, and before them those after `?`. */

/** Return the values; of two with one name the one after `#` comes last. */
export function addressValues() {
  const { search = "", hash = "" } = globalThis.location ?? {};
  return new URLSearchParams([...new URLSearchParams(search), ...new URLSearchParams(hash.slice(1))]);
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

/** Write values after the `#`, without a new entry in the history of the browser. @param {Record<string, string | null>} values */
export function writeAddress(values) {
  const hash = hashWith(location.hash, values);
  if (hash !== location.hash) history.replaceState(null, "", hash || location.pathname + location.search);
}
