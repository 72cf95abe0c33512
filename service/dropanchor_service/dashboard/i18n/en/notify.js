/** Notifications of the browser. */

export default {
  "notify.title": "Notifications",
  "notify.what": "The browser tells you about these events while the page is open, also in the background.",
  "notify.dropanchor.zone.enter": "A tag enters a zone",
  "notify.dropanchor.zone.exit": "A tag leaves a zone",
  "notify.dropanchor.zone.dwell": "A tag stays too long",
  "notify.dropanchor.zone.speed": "A tag is too fast",
  "notify.dropanchor.tags.too_close": "Tags are too close",
  "notify.dropanchor.tag.lost": "A tag is lost",
  "notify.dropanchor.tag.ambiguous": "A tag is ambiguous for long",
  "notify.dropanchor.tag.battery_low": "A battery is low",
  "notify.dropanchor.alarm.over": "An alarm is over",
  "notify.dropanchor.alarm.acknowledged": "An alarm is acknowledged",
  "notify.dropanchor.event.retracted": "An event is retracted",
  "notify.many": { one: "{n} event", other: "{n} events" },
  "notify.https": "Browsers allow notifications on pages over HTTPS only: open this page with https://.",
  "notify.unsupported": "This browser has no notifications.",
  "notify.denied": "The browser does not allow notifications: change that in its settings for this page.",
};
