import assert from "node:assert/strict";
import { test } from "node:test";

import { EventParser, eventsOf } from "../../../service/dropanchor_service/dashboard/data/events.js";

const TEXT = 'event: snapshot\ndata: {"tags":["ü"]}\n\n: alive\n\nevent: poses\ndata: {}\n\n';
const EVENTS = [{ name: "snapshot", data: '{"tags":["ü"]}' }, { name: "poses", data: "{}" }];

test("events are complete wherever the text is split", () => {
  for (let cut = 0; cut <= TEXT.length; cut++) {
    const parser = new EventParser();
    assert.deepEqual([...parser.take(TEXT.slice(0, cut)), ...parser.take(TEXT.slice(cut))], EVENTS);
  }
});

test("characters are complete wherever the bytes are split", async () => {
  const bytes = new TextEncoder().encode(TEXT);
  const body = new ReadableStream({
    start(controller) {
      for (const byte of bytes) controller.enqueue(new Uint8Array([byte]));
      controller.close();
    },
  });
  const events = [];
  for await (const event of eventsOf(new Response(body))) events.push(event);
  assert.deepEqual(events, EVENTS);
});
