import assert from "node:assert/strict";
import { test } from "node:test";

import { withoutTurn } from "../../../service/dropanchor_service/dashboard/map/draw_turn.js";

test("without the part across the bearing, the ellipse that is left is that of the shape", () => {
  for (const bearing of [0, 0.7, 2.1, -1.2]) {
    const [c, s] = [Math.cos(bearing), Math.sin(bearing)];
    const [along, across, turn] = [0.3, 0.5, 4];
    const sum = across ** 2 + turn ** 2;
    const xx = along ** 2 * c * c + sum * s * s;
    const xy = (along ** 2 - sum) * c * s;
    const yy = along ** 2 * s * s + sum * c * c;
    const { major, minor, angle } = withoutTurn([[xx, xy], [xy, yy]], turn, bearing);
    assert.ok(Math.abs(major - across) < 1e-9 && Math.abs(minor - along) < 1e-9);
    assert.ok(Math.abs(Math.sin(angle - bearing - Math.PI / 2)) < 1e-9);
  }
});
