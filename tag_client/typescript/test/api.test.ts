import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import type { Pose, PoseFrame, StreamEvent } from "../src/index.js";

type Examples = { paths: Record<string, { get: { responses: { 200: { content: Record<string, { example?: string }> } } } }> };

const FILE = new URL("../../../../schemas/dropanchor_schemas/openapi.json", import.meta.url);
const openapi = JSON.parse(readFileSync(FILE, "utf8")) as Examples;

test("an event of the stream has the columns that its type names", () => {
  const example = openapi.paths["/api/v1/stream"]!.get.responses[200].content["text/event-stream"]!.example!;
  const [, event, data] = /^event: (\w+)\ndata: (.*)\n/.exec(example)!;
  const received = { event, data: JSON.parse(data!) as PoseFrame } as StreamEvent;
  const x: PoseFrame["x"] = received.data.x;
  assert.equal(received.event, "snapshot");
  assert.equal(x.length, received.data.tags.length);
  const column: (keyof Pose)[] = ["x", "y", "heading_rad"];
  for (const name of column) assert.ok(name in received.data);
});
