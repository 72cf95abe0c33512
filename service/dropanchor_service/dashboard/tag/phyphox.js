/** The experiment for the app phyphox: its link and its QR code. Both hold the key of the tag. */

const PATH = "../api/v1/ingest/phyphox";

/** Return the link that the app opens. @param {string} tag @param {string} key empty for a service without keys */
export function phyphoxLink(tag, key) {
  const query = new URLSearchParams(key ? { tag, token: key } : { tag });
  return new URL(`${PATH}?${query}`, document.baseURI).href.replace(/^https?:/, "phyphox:");
}

/** Return the QR code as the URL of an image. Throws an error with a sentence. @param {string} tag @param {string} key */
export async function phyphoxCode(tag, key) {
  const url = new URL(`${PATH}/code?${new URLSearchParams({ tag })}`, document.baseURI);
  const response = await fetch(url, key ? { headers: { Authorization: `Bearer ${key}` } } : {});
  if (!response.ok) throw new Error((await response.json()).detail);
  return `data:image/svg+xml,${encodeURIComponent(await response.text())}`;
}
