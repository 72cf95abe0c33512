/** Read a world file: six lines with the numbers that place an image on the ground. */

import { t } from "../i18n/language.js";

const NAME = /\.(pgw|pngw|jgw|jpgw|jpegw|tfw|tifw|tiffw|wld)$/i;

/** @param {string} name of a file */
export const isWorldFile = (name) => NAME.test(name);

/** Return the numbers as the service takes them. Throws Error. @param {File} file */
export async function worldOf(file) {
  const numbers = (await file.text()).trim().split(/\s+/).map(Number);
  if (numbers.length !== 6 || !numbers.every(Number.isFinite)) throw new Error(t("plans.no_world_file", { file: file.name }));
  return numbers.join(",");
}
