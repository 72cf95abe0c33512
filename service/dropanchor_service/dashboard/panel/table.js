/** The table of all tags. Only visible rows exist in the document, so that ten thousand tags stay fast. */

import { COLUMNS } from "./columns.js";
import { count, tagCount } from "../data/format.js";
import { t } from "../i18n/language.js";
import { Order } from "../data/order.js";
import { NameColumn } from "../data/names.js";
import { symbol } from "../map/symbols.js";
import { write } from "../page/parts.js";

/** @typedef {import("../data/fleet.js").Fleet} Fleet */
/** @typedef {"only" | "toggle" | "range"} Pick how a row was chosen: alone, in addition, or all rows up to it */
/** @typedef {{element: HTMLTableRowElement, cells: HTMLTableCellElement[], use: SVGUseElement}} Line */

const ROW_PX = 32;
/** On a phone a row is as high as a finger needs. */
const TOUCH_ROW_PX = 44;
const SPARE = 4;
const NAME_LINES = 2;

export class TagTable {
  /** @type {import("../data/order.js").Sort} */
  #sort = { column: "tag", descending: false };
  #order = new Order();
  /** @type {number[]} */
  #rows = [];
  /** @type {Line[]} */
  #lines = [];
  #names = new NameColumn();
  #active = "";
  #phone = matchMedia("(max-width: 560px)");
  /** Return whether a tag is on a floor that the map does not show. */
  isElsewhere = (/** @type {number} */ _row) => false;
  /** Return 2 for a tag with an alarm, 1 with a warning, 0 with neither. */
  alarmOf = (/** @type {string} */ _tag) => 0;

  /** @param {HTMLElement} box scrolls and holds the table @param {HTMLElement} count @param {Fleet} fleet
   * @param {import("../page/choice.js").Choice} choice @param {import("./columns.js").Columns} columns
   * @param {(tags: string[], pick: Pick) => void} chosen */
  constructor(box, count, fleet, choice, columns, chosen) {
    this.box = box;
    this.count = count;
    this.fleet = fleet;
    this.choice = choice;
    this.columns = columns;
    this.chosen = chosen;
    this.body = /** @type {HTMLTableSectionElement} */ (box.querySelector("tbody"));
    this.body.addEventListener("click", (event) => this.#onClick(event));
    this.body.addEventListener("mousedown", (event) => event.shiftKey && event.preventDefault()); // it would select text
    box.addEventListener("scroll", () => this.#paint(), { passive: true });
    box.addEventListener("keydown", (event) => this.#onKey(event));
    for (const button of box.querySelectorAll("button[data-column]")) this.#listenToHead(button);
    new ResizeObserver(() => this.#paint()).observe(box);
    choice.addEventListener("change", () => this.update());
    columns.addEventListener("change", () => this.#showColumns());
    this.#showColumns();
  }

  #showColumns() {
    for (const name of COLUMNS) {
      for (const cell of /** @type {NodeListOf<HTMLElement>} */ (this.box.querySelectorAll(`.c-${name}`))) cell.hidden = !this.columns.isShown(name);
    }
    this.box.setAttribute("aria-colcount", String(1 + COLUMNS.filter((name) => this.columns.isShown(name)).length));
    this.update();
  }

  /** Sort and paint the rows with the latest poses. */
  update() {
    const wanted = (/** @type {number} */ row) => this.choice.shows(this.fleet, row);
    this.#rows = this.#order.rows(this.fleet, wanted, this.#sort, performance.now(), this.alarmOf, (column, now_ms) => this.columns.value(column, now_ms));
    const all = tagCount(this.fleet.size);
    this.count.textContent = this.choice.isFiltered ? t("count.of", { shown: count(this.#rows.length), all }) : all;
    this.#paint();
  }

  /** The tags in the table, in its order. */
  get shown() {
    return this.#rows.map((row) => this.fleet.names[row]);
  }

  /** The row that arrow keys have reached, and the id of its element. */
  get active() {
    const line = this.#lineOf(this.#active);
    return line && this.fleet.row(this.#active) >= 0 ? { tag: this.#active, id: line.element.id } : null;
  }

  /** Return the shown tag with this name or id, whatever its case; null: none. @param {string} text */
  called(text) {
    const row = this.#rows.find((one) => [this.fleet.labels[one], this.fleet.names[one]].some((name) => name.toLowerCase() === text));
    return row === undefined ? null : this.fleet.names[row];
  }

  /** Scroll to a tag, from which arrow keys go on. @param {string} tag */
  reveal(tag) {
    this.#active = tag;
    this.scrollTo(tag);
  }

  /** @param {string} tag */
  scrollTo(tag) {
    const place = this.#rows.indexOf(this.fleet.row(tag));
    if (place < 0) return;
    const [top, height] = [place * this.#rowHeight, this.box.clientHeight - this.#headHeight()];
    if (top < this.box.scrollTop) this.box.scrollTop = top;
    else if (top + this.#rowHeight > this.box.scrollTop + height) this.box.scrollTop = top + this.#rowHeight - height;
    this.#paint();
  }

  get #rowHeight() {
    return this.#phone.matches ? TOUCH_ROW_PX : ROW_PX;
  }

  #headHeight() {
    return /** @type {HTMLElement} */ (this.box.querySelector("thead")).offsetHeight;
  }

  #paint() {
    const visible = Math.ceil(this.box.clientHeight / this.#rowHeight) + SPARE;
    const last = Math.max(0, this.#rows.length - visible);
    const first = Math.min(last, Math.max(0, Math.floor(this.box.scrollTop / this.#rowHeight) - SPARE / 2));
    const rows = this.#rows.slice(first, first + visible);
    this.body.style.setProperty("--before", `${first * this.#rowHeight}px`);
    this.body.style.setProperty("--after", `${Math.max(0, this.#rows.length - first - rows.length) * this.#rowHeight}px`);
    while (this.#lines.length < rows.length) this.#addLine();
    if (this.#lines.length > 0) this.#names.measure(nameOf(this.#lines[0]), NAME_LINES);
    const now_ms = performance.now();
    this.#lines.forEach((line, i) => {
      line.element.hidden = i >= rows.length;
      if (i < rows.length) this.#fill(line, rows[i], first + i, now_ms);
    });
    this.box.setAttribute("aria-rowcount", String(this.#rows.length + 1));
    this.#pointAtActive();
  }

  #addLine() {
    const element = document.createElement("tr");
    element.id = `row-${this.#lines.length}`;
    element.setAttribute("role", "row");
    const cells = ["tag", ...COLUMNS].map((column) => {
      const cell = element.insertCell();
      cell.hidden = column !== "tag" && !this.columns.isShown(column);
      cell.className = `c-${column}`;
      cell.setAttribute("role", "gridcell");
      return cell;
    });
    const { svg, use } = symbol("initialising");
    const name = document.createElement("span");
    name.className = "name";
    cells[0].append(svg, name);
    this.body.append(element);
    this.#lines.push({ element, cells, use });
  }

  /** @param {Line} line @param {number} row @param {number} place @param {number} now_ms */
  #fill(line, row, place, now_ms) {
    const { fleet } = this;
    const state = fleet.style(row);
    const name = fleet.names[row];
    const label = fleet.labels[row];
    set(line.element.dataset, "tag", name);
    set(line.element.dataset, "state", state.name);
    set(line.element.dataset, "stale", String(fleet.staleness(row, now_ms)));
    attribute(line.element, "aria-rowindex", String(place + 2));
    attribute(line.element, "aria-selected", String(this.choice.tags.includes(name)));
    attribute(line.use, "href", `#s-${state.name}`);
    write(nameOf(line), this.#names.of(label));
    COLUMNS.forEach((column, i) => this.columns.isShown(column) && write(line.cells[i + 1], this.columns.text(column, row, now_ms)));
    const isElsewhere = this.isElsewhere(row);
    const full = label === name ? name : `${label} (${name})`;
    const alarm = this.alarmOf(name);
    const placed = isElsewhere ? t("table.elsewhere", { tag: full }) : full;
    const words = alarm === 0 ? placed : t(alarm === 2 ? "alarm.of_tag" : "alarm.warning_of_tag", { tag: placed });
    set(line.element.dataset, "alarm", String(alarm));
    set(line.element.dataset, "elsewhere", String(isElsewhere));
    attribute(line.cells[0], "title", words);
    attribute(line.cells[0], "aria-label", words);
    line.cells[0].style.setProperty("--mark", this.choice.colourOf(name) || fleet.colours[row] || "transparent");
    /** @type {HTMLTableCellElement} */ (line.cells.at(-1)).classList.toggle("yes", fleet.current && fleet.online[row] === 1);
  }

  #pointAtActive() {
    const line = this.#lineOf(this.#active);
    for (const { element } of this.#lines) element.classList.toggle("active", element === line?.element);
    if (line) this.box.setAttribute("aria-activedescendant", line.element.id);
    else this.box.removeAttribute("aria-activedescendant");
  }

  /** @param {string} tag */
  #lineOf(tag) {
    return this.#lines.find(({ element }) => !element.hidden && element.dataset.tag === tag);
  }

  /** @param {Element} button */
  #listenToHead(button) {
    const column = /** @type {HTMLElement} */ (button).dataset.column ?? "tag";
    button.addEventListener("click", () => {
      this.#sort = { column, descending: this.#sort.column === column && !this.#sort.descending };
      for (const head of this.box.querySelectorAll("th")) head.removeAttribute("aria-sort");
      button.closest("th")?.setAttribute("aria-sort", this.#sort.descending ? "descending" : "ascending");
      this.update();
    });
  }

  /** @param {MouseEvent} event */
  #onClick(event) {
    const tag = /** @type {HTMLElement} */ (event.target).closest("tr")?.dataset.tag;
    if (tag === undefined) return;
    const from = this.#active;
    this.#active = tag;
    if (event.shiftKey) this.chosen(this.#between(from, tag), "range");
    else this.chosen([tag], event.ctrlKey || event.metaKey ? "toggle" : "only");
    this.#pointAtActive();
  }

  /** Return the shown tags from one to another; only the other where the first is not shown. @param {string} from @param {string} to */
  #between(from, to) {
    const [first, last] = [from, to].map((tag) => this.#rows.indexOf(this.fleet.row(tag)));
    return first < 0 ? [to] : this.shown.slice(Math.min(first, last), Math.max(first, last) + 1);
  }

  /** @param {KeyboardEvent} event */
  #onKey(event) {
    if (event.target !== this.box || event.altKey) return;
    const isAlso = event.ctrlKey || event.metaKey;
    if (isAlso && event.key === "a") this.chosen(this.shown, "range");
    else if (!this.step(event) && (event.key === "Enter" || event.key === " ") && this.fleet.row(this.#active) >= 0) {
      this.chosen([this.#active], isAlso ? "toggle" : "only");
    } else return;
    event.preventDefault();
  }

  /** Move to another row if this key does that, and return whether it does. @param {KeyboardEvent} event */
  step(event) {
    const page = Math.max(1, Math.floor(this.box.clientHeight / this.#rowHeight) - 2);
    const steps = { ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity };
    const step = steps[/** @type {keyof typeof steps} */ (event.key)];
    if (step === undefined) return false;
    const from = this.#active;
    this.#moveActive(step);
    if (event.shiftKey) this.chosen([...this.choice.tags, ...this.#between(from, this.#active)], "range");
    event.preventDefault();
    return true;
  }

  /** @param {number} step */
  #moveActive(step) {
    if (this.#rows.length === 0) return;
    const from = this.#rows.indexOf(this.fleet.row(this.#active));
    const to = from < 0 && step === 1 ? 0 : Math.max(0, Math.min(this.#rows.length - 1, from + step));
    this.reveal(this.fleet.names[this.#rows[to]]);
  }
}

/** @param {Line} line */
const nameOf = ({ cells }) => /** @type {HTMLElement} */ (cells[0].lastElementChild);

/** Set a value only if it differs, since most cells do not change. @param {DOMStringMap} data @param {string} name
 * @param {string} value */
function set(data, name, value) {
  if (data[name] !== value) data[name] = value;
}

/** @param {Element} element @param {string} name @param {string} value */
function attribute(element, name, value) {
  if (element.getAttribute(name) !== value) element.setAttribute(name, value);
}
