/** Notifications of the browser. */

export default {
  "notify.title": "Benachrichtigungen",
  "notify.what": "Der Browser meldet diese Ereignisse, solange die Seite offen ist, auch im Hintergrund.",
  "notify.dropanchor.zone.enter": "Ein Tag betritt eine Zone",
  "notify.dropanchor.zone.exit": "Ein Tag verlässt eine Zone",
  "notify.dropanchor.zone.dwell": "Ein Tag bleibt zu lange",
  "notify.dropanchor.zone.speed": "Ein Tag ist zu schnell",
  "notify.dropanchor.tags.too_close": "Tags sind sich zu nah",
  "notify.dropanchor.tag.lost": "Ein Tag ist verloren",
  "notify.dropanchor.tag.ambiguous": "Ein Tag ist lange mehrdeutig",
  "notify.dropanchor.tag.battery_low": "Eine Batterie ist schwach",
  "notify.dropanchor.alarm.over": "Ein Alarm ist vorbei",
  "notify.dropanchor.alarm.acknowledged": "Ein Alarm ist quittiert",
  "notify.dropanchor.event.retracted": "Ein Ereignis ist zurückgezogen",
  "notify.many": { one: "{n} Ereignis", other: "{n} Ereignisse" },
  "notify.https": "Browser erlauben Benachrichtigungen nur auf Seiten über HTTPS: Öffnen Sie diese Seite mit https://.",
  "notify.unsupported": "Dieser Browser hat keine Benachrichtigungen.",
  "notify.denied": "Der Browser erlaubt keine Benachrichtigungen: Ändern Sie das in seinen Einstellungen für diese Seite.",
};
