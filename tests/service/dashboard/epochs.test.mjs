import assert from "node:assert/strict";
import { test } from "node:test";

import { EpochFence, FormerOwnerError } from "../../../service/dropanchor_service/dashboard/data/epochs.js";

test("a frame with a lower epoch than one before is refused, and the higher one stays", () => {
  const fence = new EpochFence();
  for (const frame of [{}, { epoch: 0 }, { epoch: 3 }, { epoch: 3 }]) fence.check(frame);
  for (const frame of [{ epoch: 2 }, {}]) assert.throws(() => fence.check(frame), FormerOwnerError);
  fence.check({ epoch: 3 });
  fence.check({ epoch: 4 });
  assert.throws(() => fence.check({ epoch: 3 }), FormerOwnerError);
});
