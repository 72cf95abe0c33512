/** All messages in German. */

import alarms from "./alarms.js";
import alerts from "./alerts.js";
import events from "./events.js";
import find from "./find.js";
import plans from "./plans.js";
import models from "./models.js";
import keys from "./keys.js";
import notify from "./notify.js";
import page from "./page.js";
import tags from "./tags.js";
import setup from "./setup.js";
import zones from "./zones.js";
import phone from "./phone.js";
import refusals from "./refusals.js";
import service from "./service.js";
import share from "./share.js";
import trail from "./trail.js";

export default { ...alarms, ...alerts, ...events, ...find, ...plans, ...keys, ...models, ...notify, ...page, ...tags, ...setup, ...zones, ...phone, ...service, ...refusals, ...share, ...trail };
