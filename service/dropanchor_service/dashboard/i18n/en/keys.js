/** The keys of the page. */

export default {
  "keys.title": "Keyboard",
  "keys.help": "Show the keys",
  "keys.filter": "Filter tags",
  "keys.escape": "Put the tool or the tag away, leave the wall display",
  "keys.move": "On the map: move it",
  "keys.zoom": "On the map: zoom",
  "keys.fit": "On the map: show all tags",
  "keys.measure": "While measuring: add a point in the middle of the map",
  "keys.table": "In the table: move and select",
  "keys.play": "In the past: play and pause",
  "keys.undo": "Undo the last change",
  "keys.anchor": "With a selected anchor or corner, on the map: move it by 1 m, without Shift by 0.1 m",
  "keys.corner": "On the corner of a zone: remove it",
  "keys.space": "Space",
  "keys.ctrl_z": "Ctrl Z",
  "keys.shift_arrows": "Shift ← ↑ → ↓",
  "keys.delete": "Delete",
};
