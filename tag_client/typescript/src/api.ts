/** What the service answers, by the names of its OpenAPI document, and the events of `/api/v1/stream`. */

import type { components, paths } from "./openapi.js";

export type { paths };

type Schemas = components["schemas"];

export type Anchor = Schemas["Anchor"];
export type Explanation = Schemas["Explanation"];
export type Pose = Schemas["Pose"];
export type PoseFrame = Schemas["PoseFrame"];
export type PoseList = Schemas["PoseList"];
export type Problem = Schemas["Problem"];
export type Site = Schemas["Site"];
export type TagList = Schemas["TagList"];
export type TagSettings = Schemas["TagSettings"];
export type TagStatus = Schemas["TagStatus"];
export type Track = Schemas["Track"];

/** `snapshot` comes first and names every tag; `poses` name those that have changed since. */
export type StreamEvent = { event: "snapshot"; data: PoseFrame } | { event: "poses"; data: PoseFrame };
