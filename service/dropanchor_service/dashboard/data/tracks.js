/** Stored tracks, as the service thins them, and the pose of a tag at a time between its points. */

/**
 * @typedef {object} Points columns of equal length, as in the contract
 * @property {number[]} t_ns
 * @property {string[]} state
 * @property {string[]} frame
 * @property {(number | null)[]} x
 * @property {(number | null)[]} y
 * @property {(number | null)[]} heading_rad
 * @property {(number | null)[]} speed_mps
 * @property {(number | null)[]} sigma_pos_m
 * @property {(number | null)[]} semi_major_m
 * @property {(number | null)[]} semi_minor_m
 * @property {(number | null)[]} angle_rad
 * @property {("tracking" | "doubtful" | "unknown")[]} since_previous
 *
 * @typedef {object} TagTrack as in the contract
 * @property {string} tag
 * @property {number} poses
 * @property {number} tracked_s
 * @property {number} distance_m
 * @property {number | null} mean_speed_mps
 * @property {number | null} max_speed_mps
 * @property {Points} points
 */

/** Points further apart are not joined: what the tag did in between is not known well enough. */
const JOIN_MS = 10_000;

/** One tag's points with times in ms. A place in a frame of the tag's own is no place of the map: it is unknown here. */
export class Track {
  /** @param {TagTrack} track */
  constructor({ tag, points }) {
    const onMap = points.frame.map((frame) => frame !== "relative");
    this.tag = tag;
    this.points = points;
    this.time = Float64Array.from(points.t_ns, (t_ns) => t_ns / 1e6);
    this.x = Float64Array.from(points.x, (x, i) => (onMap[i] ? (x ?? NaN) : NaN));
    this.y = Float64Array.from(points.y, (y, i) => (onMap[i] ? (y ?? NaN) : NaN));
  }

  /** Return the index of the last point at or before a time; −1: none. @param {number} time_ms */
  before(time_ms) {
    let [low, high] = [0, this.time.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time[middle] <= time_ms) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  /** Return how far a time lies between a point and the next, 0 to 1, if the tag was known all the way; else null.
   * @param {number} i @param {number} time_ms */
  shareAfter(i, time_ms) {
    const length = this.time[i + 1] - this.time[i];
    if (!(length <= JOIN_MS) || this.points.since_previous[i + 1] === "unknown") return null;
    return (time_ms - this.time[i]) / length;
  }
}

/**
 * Return what the stream would have sent at a time in the past: the pose of every tag that had one by then.
 * @param {readonly Track[]} tracks @param {number} time_ms
 * @returns {import("./fleet.js").Frame}
 */
export function frameAt(tracks, time_ms) {
  const poses = tracks.flatMap((track) => poseAt(track, time_ms) ?? []);
  /** @type {Record<string, any[]>} */
  const columns = {};
  for (const name of FIELDS) columns[name] = poses.map((pose) => pose[name]);
  return { t_ns: time_ms * 1e6, tags: poses.map(({ tag }) => tag), ...columns };
}

const FIELDS = [
  "state", "frame", "x", "y", "heading_rad", "speed_mps", "sigma_pos_m", "semi_major_m", "semi_minor_m", "angle_rad", "age_s",
  ...["reason", "hint", "anchor", "hypotheses", "yaw_rate_radps", "p_mode", "range_m", "sigma_obs_m", "online"], // not stored: unknown
];

/** Return the pose at a time: between two points if the tag was known all the way, else the last point with its age.
 * @param {Track} track @param {number} time_ms @returns {Record<string, any> | null} null: none yet */
export function poseAt(track, time_ms) {
  const i = track.before(time_ms);
  if (i < 0) return null;
  const { points } = track;
  const share = track.shareAfter(i, time_ms) ?? 0;
  const wider = share > 0 && (points.semi_major_m[i + 1] ?? 0) > (points.semi_major_m[i] ?? 0) ? i + 1 : i;
  const isKnown = share > 0 || time_ms === track.time[i];
  return {
    tag: track.tag,
    state: points.state[i],
    frame: points.frame[i],
    x: mixed(track.x, i, share),
    y: mixed(track.y, i, share),
    heading_rad: turned(points.heading_rad[i], points.heading_rad[i + 1], share),
    speed_mps: mixed(points.speed_mps, i, share),
    sigma_pos_m: points.sigma_pos_m[wider],
    semi_major_m: points.semi_major_m[wider],
    semi_minor_m: points.semi_minor_m[wider],
    angle_rad: points.angle_rad[wider],
    age_s: isKnown ? 0 : (time_ms - track.time[i]) / 1000,
  };
}

/** @param {ArrayLike<number | null>} values @param {number} i @param {number} share */
function mixed(values, i, share) {
  const [from, to] = [values[i], values[i + 1]];
  if (from === null || Number.isNaN(from)) return null;
  return share > 0 && to !== null ? from + share * (to - from) : from;
}

/** Return a direction between two, the short way round. @param {number | null} from @param {number | null} to
 * @param {number} share */
function turned(from, to, share) {
  if (from === null || share === 0 || to === null) return from;
  const turn = Math.atan2(Math.sin(to - from), Math.cos(to - from));
  return from + share * turn;
}
