/** The units of lengths and speeds on the page. */

/** The symbol of each unit on the page. */
export const SYMBOLS = { length: "m", speed: "m/s" };
