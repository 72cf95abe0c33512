export * from "./api.js";
export * from "./keys.js";
export * from "./samples.js";
