/** A DWM1001 near this device, by Web Bluetooth (Chrome and Edge, over HTTPS). */

import { DISTANCES, LOCATION_DATA, LOCATION_DATA_MODE, POSITION, SERVICE, rangesOf } from "./location_data.js";
import { anchorNumber } from "./packed.js";
import { t } from "../i18n/language.js";

/** Modules announce the service as data only, which no filter of a browser sees; their name is DW and four digits. */
const NAME_PREFIX = "DW";
const RETRY_MS = [500, 1000, 2000, 5000];
/** A module at rest may report every 10 s only. */
const SILENT_MS = 12_000;
/** Errors after which another attempt is of no use. */
const FINAL = new Set(["NotFoundError", "SecurityError"]);

/**
 * What is used of Web Bluetooth, whose types no standard library has.
 * @typedef {EventTarget & {
 *   value?: DataView, readValue: () => Promise<DataView>, startNotifications: () => Promise<unknown>,
 *   writeValueWithResponse: (value: BufferSource) => Promise<void>
 * }} Characteristic
 * @typedef {{ getCharacteristic: (uuid: string) => Promise<Characteristic> }} Service
 * @typedef {{ getPrimaryService: (uuid: string) => Promise<Service> }} Server
 * @typedef {EventTarget & { gatt: { connect: () => Promise<Server> } }} Device
 * @typedef {{ requestDevice: (options: object) => Promise<Device> }} WebBluetooth
 */

export const hasBluetooth = () => "bluetooth" in navigator;

export class Bluetooth {
  /** A sentence for the person. */
  problem = "";
  connected = false;
  ranges = 0;
  /** Notifications that have not the form they should have. */
  damaged = 0;
  #device = /** @type {Device | null} */ (null);
  #timer = 0;

  /** @param {import("./clock.js").Clock} clock @param {(sample: import("./packed.js").RangeSample) => void} take */
  constructor(clock, take) {
    this.clock = clock;
    this.take = take;
  }

  /** Let the person choose a module, and listen to it until another one is chosen. Call it in a tap. */
  async connect() {
    const { bluetooth } = /** @type {{ bluetooth: WebBluetooth }} */ (/** @type {unknown} */ (navigator));
    this.problem = "";
    try {
      const filters = [{ services: [SERVICE] }, { namePrefix: NAME_PREFIX }];
      this.#device = await bluetooth.requestDevice({ filters, optionalServices: [SERVICE] });
    } catch (error) {
      this.problem = t("phone.not_chosen", { message: /** @type {Error} */ (error).message });
      return;
    }
    await this.#stay(this.#device);
  }

  /** Connect, and connect again after each interruption. @param {Device} device */
  async #stay(device) {
    for (let attempt = 0; device === this.#device; attempt++) {
      try {
        await this.#listen(device);
        attempt = 0;
        this.problem = t("phone.out_of_reach");
      } catch (error) {
        const { name, message } = /** @type {Error} */ (error);
        this.problem = t("phone.unreadable", { message });
        if (FINAL.has(name)) return;
      }
      await new Promise((resolve) => setTimeout(resolve, RETRY_MS[Math.min(attempt, RETRY_MS.length - 1)]));
    }
  }

  /** Listen until the connection ends. @param {Device} device */
  async #listen(device) {
    const ended = new Promise((resolve) => device.addEventListener("gattserverdisconnected", resolve, { once: true }));
    const server = await device.gatt.connect();
    const service = await server.getPrimaryService(SERVICE);
    await reportDistances(await service.getCharacteristic(LOCATION_DATA_MODE));
    const data = await service.getCharacteristic(LOCATION_DATA);
    data.addEventListener("characteristicvaluechanged", () => data.value && this.#received(data.value));
    await data.startNotifications();
    this.connected = true;
    this.problem = "";
    this.#timer = setTimeout(() => this.#complain(), SILENT_MS);
    await ended;
    clearTimeout(this.#timer);
    this.connected = false;
  }

  /** @param {DataView} value */
  #received(value) {
    const t_us = this.clock.local_us();
    const ranges = rangesOf(value);
    if (ranges === null) this.damaged++;
    for (const { anchor, range_m } of ranges ?? []) {
      clearTimeout(this.#timer);
      this.problem = "";
      this.ranges++;
      this.take({ t_us, anchor: anchorNumber(anchor), range_m });
    }
  }

  #complain() {
    this.problem = t("phone.reports_nothing");
  }
}

/** Make the module report distances, if it reports its position only. @param {Characteristic} mode */
async function reportDistances(mode) {
  const value = await mode.readValue();
  if (value.byteLength && value.getUint8(0) !== POSITION) return;
  await mode.writeValueWithResponse(Uint8Array.of(DISTANCES));
}
