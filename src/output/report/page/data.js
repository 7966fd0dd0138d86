// Reads the data of the page: JSON as it is, and arrays that were compressed by deflate and coded in base64.

const $ = (id) => document.getElementById(id);

/** An element. Children that are texts become text nodes, so that no text of a file is ever markup. */
function el(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== undefined && value !== null) node.setAttribute(name, value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

/** A narrow page, as style.css has it. */
const NARROW = "(max-width: 900px)";

const json = (id) => JSON.parse($(id).textContent);

/** What the drive was divided into, in words. */
const THINGS = json("data-run").result.surfaces ? { one: "surface", many: "surfaces" } : { one: "object", many: "objects" };
/** The units of the coordinates of the input: in the plane, and of heights. */
const UNITS = json("data-page").units;

/** The bytes of a compressed part. */
async function inflated(id) {
  const coded = atob($(id).textContent.trim());
  const bytes = new Uint8Array(coded.length);
  for (let at = 0; at < coded.length; at++) bytes[at] = coded.charCodeAt(at);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Bytes of a point: key, place and intensity in the page; more of the intensity, and the class, in what is streamed. */
const SAMPLE_PLANES = 17, STREAMED_PLANES = 19;

/**
 * The points. The bytes are planes of `count` values: key (4 bytes, difference to the point before), x, y, z (4 bytes
 * each, difference to the point before, the sign in the lowest bit), and more. Key 0 is ground, 1 is a point of no
 * object, and k + 1 is object k. `toPage` has the metres of a step and those of the origin, for each axis.
 */
function readPoints(bytes, count, toPage) {
  const keys = new Uint32Array(count);
  const places = new Float32Array(3 * count);
  const word = (plane, at) => {
    const start = plane * count + at;
    return (bytes[start] | (bytes[start + count] << 8) | (bytes[start + 2 * count] << 16) | (bytes[start + 3 * count] << 24)) >>> 0;
  };
  let key = 0;
  for (let at = 0; at < count; at++) keys[at] = key += word(0, at);
  for (let axis = 0; axis < 3; axis++) {
    const [step, origin] = toPage[axis];
    let place = 0;
    for (let at = 0; at < count; at++) {
      const coded = word(4 + 4 * axis, at);
      // As an integer of 32 bits, as the difference was made.
      place = (place + ((coded >>> 1) ^ -(coded & 1))) | 0;
      places[3 * at + axis] = place * step + origin;
    }
  }
  return { count, keys, places };
}

/** The points of the page: with their shades. */
function readSample(bytes, count, step) {
  const points = readPoints(bytes, count, [[step, 0], [step, 0], [step, 0]]);
  return { ...points, intensities: bytes.subarray(16 * count, SAMPLE_PLANES * count), classes: null };
}

/** Streamed points: with their classes, and with shades between the intensities `low` and `high`. */
function readStreamed(bytes, toPage, [low, high]) {
  const count = bytes.length / STREAMED_PLANES;
  const intensities = new Uint8Array(count);
  for (let at = 0; at < count; at++) {
    const intensity = bytes[16 * count + at] | (bytes[17 * count + at] << 8);
    intensities[at] = ((Math.min(high, Math.max(low, intensity)) - low) * 255) / Math.max(1, high - low);
  }
  return { ...readPoints(bytes, count, toPage), intensities, classes: bytes.subarray(18 * count) };
}

/** Height of the ground on a raster of 4 m, from the ground points. Cells without ground take that of the nearest. */
class Ground {
  constructor(points) {
    this.edge = 4;
    this.cells = new Map();
    for (let at = 0; at < points.count && points.keys[at] === 0; at++) {
      const key = this.key(points.places[3 * at], points.places[3 * at + 1]);
      const z = points.places[3 * at + 2];
      const cell = this.cells.get(key);
      if (cell) { cell.sum += z; cell.count++; } else this.cells.set(key, { sum: z, count: 1 });
    }
    for (const cell of this.cells.values()) cell.z = cell.sum / cell.count;
    let lowest = Infinity;
    for (let at = 0; at < points.count; at++) lowest = Math.min(lowest, points.places[3 * at + 2]);
    this.lowest = Number.isFinite(lowest) ? lowest : 0;
    this.found = new Map();
  }

  /** Area of the cells with ground in square metres. */
  area() { return this.cells.size * this.edge ** 2; }

  key(x, y) {
    return (Math.floor(x / this.edge) + 0x100000) * 0x200000 + Math.floor(y / this.edge) + 0x100000;
  }

  /** Height of the ground at a place. */
  height(x, y) {
    const own = this.key(x, y);
    const cell = this.cells.get(own);
    if (cell) return cell.z;
    let z = this.found.get(own);
    if (z !== undefined) return z;
    z = this.lowest;
    search: for (let ring = 1; ring <= 12; ring++) {
      for (let i = -ring; i <= ring; i++) {
        for (let j = -ring; j <= ring; j += Math.abs(i) === ring ? 1 : 2 * ring) {
          const near = this.cells.get(own + i * 0x200000 + j);
          if (near) { z = near.z; break search; }
        }
      }
    }
    this.found.set(own, z);
    return z;
  }
}

/** The axis: stretches of vertices with their chainage. */
class Axis {
  /**
   * With a section, its ends: the vertices of the axis rarely lie on them. `length` is that of the whole axis in
   * metres.
   */
  constructor(stretches, section, length) {
    this.stretches = stretches.filter((stretch) => stretch.s.length > 0);
    this.from = section?.from_m ?? (this.stretches.length ? this.stretches[0].s[0] : 0);
    this.to = section?.to_m ?? (this.stretches.length ? length : 1);
  }

  /** Place and heading (radians from the east) at a chainage. */
  at(s) {
    const stretch = this.stretches.findLast((stretch) => stretch.s[0] <= s) ?? this.stretches[0];
    if (!stretch) return { x: 0, y: 0, heading: 0 };
    const { s: stations, x, y } = stretch;
    let low = 0, high = stations.length - 1;
    while (high - low > 1) { const middle = (low + high) >> 1; if (stations[middle] <= s) low = middle; else high = middle; }
    if (high === low) return { x: x[low], y: y[low], heading: 0 };
    const share = Math.min(1, Math.max(0, (s - stations[low]) / (stations[high] - stations[low] || 1)));
    // The heading is taken over some metres, because single vertices wobble.
    const back = Math.max(0, low - 3), ahead = Math.min(stations.length - 1, high + 5);
    return {
      x: x[low] + share * (x[high] - x[low]), y: y[low] + share * (y[high] - y[low]),
      heading: Math.atan2(y[ahead] - y[back], x[ahead] - x[back]),
    };
  }
}

const capital = (text) => text[0].toUpperCase() + text.slice(1);

/** A number with the thing that is counted. */
const counted = (count, thing) => `${shown(count)} ${thing}${count === 1 ? "" : "s"}`;

/** A number as a person reads it. */
function shown(value, places) {
  return value.toLocaleString("en", { minimumFractionDigits: places ?? 0, maximumFractionDigits: places ?? 3 });
}
