import assert from "node:assert/strict";
import { test } from "node:test";

const { Choice, COLOURS, MOST_SELECTED } = await import("../../../service/dropanchor_service/dashboard/page/choice.js");
const { STATES, stateNumber } = await import("../../../service/dropanchor_service/dashboard/data/states.js");
const { listIn, listText } = await import("../../../service/dropanchor_service/dashboard/data/address.js");
const { joinedCsv, joinedGeojson } = await import("../../../service/dropanchor_service/dashboard/data/joined_tracks.js");
const { latLonOfSite, siteOfLatLon } = await import("../../../service/dropanchor_service/dashboard/plan/geodesy.js");

const toggle = (choice, tag) => choice.selectAll(choice.toggled(tag), choice.gathering);

test("one selected tag is no group of tags, however it was selected", () => {
  const choice = new Choice();
  choice.select("a");
  toggle(choice, "b");
  assert.deepEqual([choice.selected, choice.several], [null, ["a", "b"]]);
  toggle(choice, "a");
  assert.deepEqual([choice.selected, choice.several], ["b", []]);
  toggle(choice, "b");
  assert.deepEqual([choice.selected, choice.tags], [null, []]);
});

test("a selected tag keeps its colour while it is selected, and no other one has it while there are enough", () => {
  const choice = new Choice();
  choice.selectAll(["a", "b", "c"]);
  const [, b, c] = ["a", "b", "c"].map((tag) => choice.colourOf(tag));
  choice.selectAll(["b", "d", "c", "e"]);
  assert.deepEqual([choice.colourOf("b"), choice.colourOf("c"), choice.colourOf("a")], [b, c, ""]);
  assert.equal(new Set(["b", "c", "d", "e"].map((tag) => choice.colourOf(tag))).size, 4);
});

/** What people without cones of one kind see of linear red, green and blue (Machado, Oliveira and Fernandes, 2009). */
const SEEN = [
  [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
  [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
  [[0.367, 0.861, -0.228], [0.28, 0.673, 0.047], [-0.012, 0.043, 0.969]],
  [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
];
const XYZ = [[0.4339, 0.3762, 0.1899], [0.2126, 0.7152, 0.0722], [0.0177, 0.1095, 0.8729]]; // relative to white
const times = (matrix, vector) => matrix.map((row) => row.reduce((sum, one, i) => sum + one * vector[i], 0));

/** Return a colour in CIE Lab, as seen. @param {string} colour @param {number[][]} seen */
function lab(colour, seen) {
  const linear = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16) / 255).map((part) => ((part + 0.055) / 1.055) ** 2.4);
  const [x, y, z] = times(XYZ, times(seen, linear).map((part) => Math.min(1, Math.max(0, part)))).map((part) => (part > 0.0089 ? Math.cbrt(part) : 7.787 * part + 0.138));
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}

test("the colours of selected tags differ for people with any colour vision", () => {
  const pairs = COLOURS.flatMap((one, i) => COLOURS.slice(i + 1).map((other) => [one, other]));
  for (const [one, other] of pairs) {
    for (const seen of SEEN) {
      const [a, b] = [one, other].map((colour) => lab(colour, seen));
      assert.ok(Math.hypot(...a.map((part, i) => part - b[i])) > 20, `${one} ${other}`);
    }
  }
});

test("while tags are gathered even one is a group, until the last is taken out", () => {
  const choice = new Choice();
  choice.selectAll(["a"], true);
  assert.deepEqual([choice.selected, choice.several], [null, ["a"]]);
  toggle(choice, "b");
  toggle(choice, "a");
  assert.deepEqual(choice.several, ["b"]);
  toggle(choice, "b");
  assert.equal(choice.gathering, false);
});

test("following ends with the selection, and not with a change of it", () => {
  const choice = new Choice();
  choice.selectAll(["a", "b", "a"]);
  assert.deepEqual(choice.tags, ["a", "b"]);
  choice.follow = true;
  toggle(choice, "c");
  assert.equal(choice.follow, true);
  choice.select(null);
  assert.equal(choice.follow, false);
});

test("the same selection again is no change, and a very large one is cut", () => {
  const choice = new Choice();
  let changes = 0;
  choice.addEventListener("change", () => changes++);
  choice.selectAll(Array.from({ length: MOST_SELECTED + 5 }, (_, i) => `tag-${i}`));
  choice.selectAll([...choice.tags]);
  toggle(choice, "one more");
  assert.equal(choice.tags.length, MOST_SELECTED);
  assert.equal(changes, 1);
});

test("a state shows only its tags, more states show theirs, too, and without any all tags are shown", () => {
  const choice = new Choice();
  const [tracking, degraded, lost] = ["tracking", "degraded", "lost"].map(stateNumber);
  const shown = (/** @type {number} */ state) => {
    choice.chooseState(state);
    return [...STATES.keys()].filter((one) => !choice.hiddenStates.has(one));
  };
  assert.deepEqual(shown(lost), [lost]);
  assert.deepEqual(shown(degraded), [degraded, lost]);
  assert.deepEqual(shown(lost), [degraded]);
  assert.deepEqual(shown(degraded), [...STATES.keys()]);
  assert.ok(!choice.isFiltered);
  assert.deepEqual(shown(tracking), [tracking]);
});

test("words of the filter name a zone, a floor, a group or a state, and all of them must hold", () => {
  const zones = { a: ["Ramp 2"], b: ["Dock", "Ramp 2"], "lost-1": [] };
  const choice = new Choice({}, (tag) => zones[tag]);
  const names = Object.keys(zones);
  const fleet = {
    names, labels: ["A", "B", "C"], groups: ["forklifts", "", ""], value: { floor: ["Hall", null, "Hall"] },
    state: [stateNumber("lost"), stateNumber("tracking"), stateNumber("tracking")],
  };
  const shown = (/** @type {string} */ text) => {
    choice.text = text;
    return names.filter((_, row) => choice.shows(/** @type {any} */ (fleet), row));
  };
  assert.deepEqual(shown("zone:RAMP"), ["a", "b"]);
  assert.ok(choice.asksFor("zone"));
  assert.deepEqual(shown("zone:ramp zone:dock"), ["b"]);
  assert.deepEqual(shown("floor:hall group:fork"), ["a"]);
  assert.deepEqual(shown("lost"), ["a", "lost-1"]); // by its state, and by its name
  assert.deepEqual(shown("time:12"), []);
});

test("names with commas, signs and spaces stay whole in the list of the address", () => {
  const names = ["a,b", "100 %", "süd & co", "cart-1"];
  const values = new URLSearchParams(new URLSearchParams({ tags: listText(names) }).toString());
  assert.deepEqual(listIn(values.get("tags") ?? ""), names);
  assert.deepEqual(listIn("a,%zz,,b"), ["a", "%zz", "b"]);
});

test("joined tracks name the tag of each pose, and have one head", () => {
  const parts = [{ tag: "a", text: "t_ns,x\r\n1,2\r\n3,4\r\n" }, { tag: "b,c", text: "t_ns,x\r\n5,6\r\n" }, { tag: "none", text: "" }];
  assert.equal(joinedCsv(parts), 'tag,t_ns,x\r\na,1,2\r\na,3,4\r\n"b,c",5,6\r\n');
  const text = JSON.stringify({ type: "FeatureCollection", features: [{ type: "Feature", geometry: null, properties: { x: 1 } }] });
  const { features } = JSON.parse(joinedGeojson([{ tag: "a", text }, { tag: "b", text }]));
  assert.deepEqual(features.map((/** @type {any} */ { properties }) => properties), [{ tag: "a", x: 1 }, { tag: "b", x: 1 }]);
});

test("latitude and longitude of a place lead back to it", () => {
  const origin = { lat: 52.5, lon: 13.4, rotation_rad: 0.7 };
  for (const [x, y] of [[0, 0], [30, -12], [-4000, 2500]]) {
    const [back_x, back_y] = siteOfLatLon(origin, latLonOfSite(origin, x, y));
    assert.ok(Math.hypot(back_x - x, back_y - y) < 1e-4, `${back_x}, ${back_y}`);
  }
});
