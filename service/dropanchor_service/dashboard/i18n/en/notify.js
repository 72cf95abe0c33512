/** Notifications of the browser. */

export default {
  "notify.title": "Notifications",
  "notify.what": "The browser tells you about these events while the page is open, also in the background.",
  "notify.many": { one: "{n} event", other: "{n} events" },
  "notify.https": "Browsers allow notifications on pages over HTTPS only: open this page with https://.",
  "notify.unsupported": "This browser has no notifications.",
  "notify.denied": "The browser does not allow notifications: change that in its settings for this page.",
};
