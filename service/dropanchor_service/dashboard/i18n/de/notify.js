/** Notifications of the browser. */

export default {
  "notify.title": "Benachrichtigungen",
  "notify.what": "Der Browser meldet diese Ereignisse, solange die Seite offen ist, auch im Hintergrund.",
  "notify.many": { one: "{n} Ereignis", other: "{n} Ereignisse" },
  "notify.https": "Browser erlauben Benachrichtigungen nur auf Seiten über HTTPS: Öffnen Sie diese Seite mit https://.",
  "notify.unsupported": "Dieser Browser hat keine Benachrichtigungen.",
  "notify.denied": "Der Browser erlaubt keine Benachrichtigungen: Ändern Sie das in seinen Einstellungen für diese Seite.",
};
