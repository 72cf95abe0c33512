/** Server-sent events of an answer. The browser's own EventSource cannot send a key. */

/** @typedef {{name: string, data: string}} ServerEvent */

/** Takes text in pieces of any length, gives whole events. Comments are left out. */
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

/** Until the service ends the stream, or throws. @param {Response} answer @returns {AsyncGenerator<ServerEvent>} */
export async function* eventsOf(answer) {
  const reader = /** @type {ReadableStream<Uint8Array>} */ (answer.body).getReader();
  const decoder = new TextDecoder();
  const parser = new EventParser();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    yield* parser.take(decoder.decode(value, { stream: true }));
  }
}
