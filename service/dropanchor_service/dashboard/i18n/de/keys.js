/** The keys of the page. */

export default {
  "keys.title": "Tastatur",
  "keys.help": "Tasten zeigen",
  "keys.filter": "Tags filtern",
  "keys.escape": "Werkzeug oder Tag weglegen, Wandanzeige beenden",
  "keys.move": "Auf der Karte: verschieben",
  "keys.zoom": "Auf der Karte: Maßstab ändern",
  "keys.fit": "Auf der Karte: alle Tags zeigen",
  "keys.measure": "Beim Messen: Punkt in der Kartenmitte setzen",
  "keys.table": "In der Tabelle: bewegen und auswählen",
  "keys.play": "In der Vergangenheit: abspielen und anhalten",
  "keys.undo": "Letzte Änderung rückgängig machen",
  "keys.anchor": "Mit ausgewähltem Anker oder ausgewählter Ecke, auf der Karte: um 1 m verschieben, ohne Umschalt um 0,1 m",
  "keys.corner": "Auf der Ecke einer Zone: entfernen",
  "keys.space": "Leertaste",
  "keys.ctrl_z": "Strg Z",
  "keys.shift_arrows": "Umschalt ← ↑ → ↓",
  "keys.delete": "Entf",
};
