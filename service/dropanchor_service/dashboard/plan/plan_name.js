/** Names of floor plans. */

const MAX_NAME = 64;

/** Return the name of a new plan: that of its file, with a number where another plan has it already.
 * @param {string} name @param {readonly {name: string}[]} plans */
export function newName(name, plans) {
  const taken = new Set(plans.map((plan) => plan.name));
  for (let number = 1; ; number++) {
    const suffix = number === 1 ? "" : ` ${number}`;
    const found = name.slice(0, MAX_NAME - suffix.length) + suffix;
    if (name === "" || !taken.has(found)) return found;
  }
}
