/** Read the server-sent events of a response. The browser's own EventSource cannot send a key. */

/** @typedef {{name: string, data: string}} ServerEvent */

/** Collect text in pieces of any length and return complete events without comments. */
export class EventParser {
  #rest = "";

  /** @param {string} text @returns {ServerEvent[]} */
  take(text) {
    const blocks = (this.#rest + text).split("\n\n");
    this.#rest = blocks.pop() ?? "";
    return blocks.map(eventOf).filter(({ data }) => data !== "");
  }
}

/** @param {string} block @returns {ServerEvent} */
function eventOf(block) {
  const event = { name: "message", data: "" };
  for (const line of block.split("\n")) {
    if (line.startsWith("event: ")) event.name = line.slice(7);
    else if (line.startsWith("data: ")) event.data += line.slice(6);
  }
  return event;
}

/** Yield events until the service ends the stream. Throws when the connection fails. @param {Response} response @returns {AsyncGenerator<ServerEvent>} */
export async function* eventsOf(response) {
  const reader = /** @type {ReadableStream<Uint8Array>} */ (response.body).getReader();
  const decoder = new TextDecoder();
  const parser = new EventParser();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    yield* parser.take(decoder.decode(value, { stream: true }));
  }
}
