/** Read a world file: six lines with the numbers that place an image on the ground. */

const NAME = /\.(pgw|pngw|jgw|jpgw|jpegw|tfw|tifw|tiffw|wld)$/i;

/** @param {string} name of a file */
export const isWorldFile = (name) => NAME.test(name);

/** Return the numbers as the service takes them. Throws Error. @param {File} file */
export async function worldOf(file) {
  const numbers = (await file.text()).trim().split(/\s+/).map(Number);
  if (numbers.length !== 6 || !numbers.every(Number.isFinite)) throw new Error(`${file.name} is no world file: it must hold six numbers.`);
  return numbers.join(",");
}
