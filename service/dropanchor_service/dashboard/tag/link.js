/** Which tag this device is, and its key: from the link `/tag/#key=…&tag=…`, or typed. They last until the tab closes. */

const KEY = "dropanchor.tag.key";
const TAG = "dropanchor.tag.name";

/** Take the key and the tag out of the address, so that neither stays in the history or on a screenshot. */
export function takeFromAddress() {
  const given = new URLSearchParams(location.hash.slice(1));
  const tag = given.get("tag");
  if (tag !== null) remember(tag, given.get("key") ?? "");
  if (location.hash) history.replaceState(null, "", location.pathname);
}

/** @param {string} tag @param {string} key empty for a service without keys */
export function remember(tag, key) {
  sessionStorage.setItem(TAG, tag);
  sessionStorage.setItem(KEY, key);
}

/** Return the tag and its key; null when the person has to give them. */
export function remembered() {
  const tag = sessionStorage.getItem(TAG);
  return tag ? { tag, key: sessionStorage.getItem(KEY) ?? "" } : null;
}
