// The colours of classes and objects, the ramps of height and intensity, and the colour of a point.

/** The list of palette.rs, which the layers for QGIS use, too. */
const CLASS_COLOURS = json("data-page").colours;
const GROUND_COLOUR = { light: "#c9c1b2", dark: "#575650" };
const LOOSE_COLOUR = { light: "#a9afb8", dark: "#4a505a" };
/** Viridis (Smith and van der Walt, 2015) at even steps. */
const HEIGHT_RAMP = ["#440154", "#443983", "#31688e", "#21918c", "#35b779", "#90d743", "#fde725"];
const INTENSITY_RAMP = { light: ["#1a1d22", "#8d929a", "#e9ebee"], dark: ["#2a2e35", "#8f959d", "#ffffff"] };
/** Where the ramp of heights ends, in metres over the ground. */
const HIGHEST_M = 12;

const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));

/** A colour with a share of another one. */
function mixed(one, other, share) {
  const [from, to] = [rgb(one), rgb(other)];
  return `rgb(${from.map((part, at) => Math.round(part + share * (to[at] - part))).join(", ")})`;
}

function classColour(code) {
  return CLASS_COLOURS[code] ?? hueColour(code * 7 + 3);
}

/** Colours that differ for neighbouring numbers: hues a golden angle apart, in three tones. */
function hueColour(number) {
  const hue = (number * 137.508) % 360, tone = number % 3;
  const s = [0.5, 0.6, 0.45][tone], l = [0.58, 0.52, 0.68][tone];
  const part = (n) => {
    const k = (n + hue / 30) % 12;
    const value = l - s * Math.min(l, 1 - l) * Math.max(-1, Math.min(k - 3, 9 - k, 1));
    return Math.round(255 * value).toString(16).padStart(2, "0");
  };
  return `#${part(0)}${part(8)}${part(4)}`;
}

/** 256 colours between those of a ramp, as one array of red, green, blue. */
function ramp(colours) {
  const table = new Uint8Array(768);
  const stops = colours.map(rgb);
  for (let at = 0; at < 256; at++) {
    const place = (at / 255) * (stops.length - 1), low = Math.min(stops.length - 2, Math.floor(place));
    for (let part = 0; part < 3; part++) table[3 * at + part] = stops[low][part] + (place - low) * (stops[low + 1][part] - stops[low][part]);
  }
  return table;
}

/** A function that colours points: `(points, point, rgba, at)` writes red, green and blue, and returns whether the point is shown. */
function colouring({ mode, theme, ground, hidden, rowOf, classOf, isShown }) {
  const groundColour = rgb(GROUND_COLOUR[theme.name]), looseColour = rgb(LOOSE_COLOUR[theme.name]);
  const heights = ramp(HEIGHT_RAMP), grays = ramp(INTENSITY_RAMP[theme.name]);
  const kept = new Map();
  const ofKey = (key, streamedClass) => {
    let found = kept.get(key);
    if (found) return found;
    // A page with a limit may have no row for an object that is streamed.
    const row = rowOf(key - 1) ?? -1, code = row >= 0 ? classOf(row) : streamedClass;
    found = [...rgb(mode === "class" ? classColour(code) : hueColour(key)), isShown(row, code)];
    kept.set(key, found);
    return found;
  };
  return (points, point, look, to) => {
    const key = points.keys[point];
    let colour = key === 0 ? groundColour : key === 1 ? looseColour : ofKey(key, points.classes?.[point] ?? 0);
    const visible = key === 0 ? !hidden.has("ground") : key === 1 ? !hidden.has("loose") : colour[3];
    // The intensity shows markings and bark in every mode.
    let from = 0, light = 0.74 + points.intensities[point] / 800;
    if (mode === "height") {
      const over = points.places[3 * point + 2] - ground.height(points.places[3 * point], points.places[3 * point + 1]);
      from = 3 * Math.max(0, Math.min(255, Math.round((over / HIGHEST_M) * 255)));
      colour = heights;
      light = 1;
    } else if (mode === "intensity") {
      from = 3 * points.intensities[point];
      colour = grays;
      light = 1;
    }
    for (let part = 0; part < 3; part++) look[to + part] = Math.min(255, colour[from + part] * light);
    return visible;
  };
}
