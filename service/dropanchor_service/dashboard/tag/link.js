/** Which tag this device is, and its key: from the link `/tag/#key=…&tag=…`, or typed. They last until the tab closes. */

const KEY = "dropanchor.tag.key";
const TAG = "dropanchor.tag.name";

/** The site of this device, of a service with several: `?site=` in the address. Null: that of the key, or the only one. */
const site = new URLSearchParams(globalThis.location?.search ?? "").get("site");

/** Return the URL of a path for samples. @param {string} path */
export function ingest(path) {
  const ofSite = site === null ? "" : `sites/${encodeURIComponent(site)}/`;
  return new URL(`../api/v1/${ofSite}ingest/${path}`, document.baseURI);
}

/** Return the name under which the samples of a tag wait in this browser. @param {string} tag */
export const storeOf = (tag) => (site === null ? tag : `${encodeURIComponent(site)}/${tag}`);

/** Take the key and the tag out of the address, so that neither stays in the history or on a screenshot. */
export function takeFromAddress() {
  const given = new URLSearchParams(location.hash.slice(1));
  const tag = given.get("tag");
  if (tag !== null) remember(tag, given.get("key") ?? "");
  const kept = site === null ? "" : `?${new URLSearchParams({ site })}`;
  if (location.hash) history.replaceState(null, "", location.pathname + kept);
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
