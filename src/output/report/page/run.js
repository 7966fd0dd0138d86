// What the run did: figures, warnings, passes with their times, input, settings. The numbers are those of report.json.

/** Files that are listed. */
const MOST_FILES = 200;

function mebibytes(bytes) {
  return bytes < 1024 ** 3 ? `${shown(bytes / 1024 ** 2, 0)} MiB` : `${shown(bytes / 1024 ** 3, 2)} GiB`;
}

function seconds(value) {
  if (value < 100) return `${shown(value, value < 10 ? 2 : 1)} s`;
  const minutes = Math.round(value / 60);
  return minutes < 100 ? `${minutes} min` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

/**
 * A share in per cent: with one decimal, or with two digits below one per cent, so that a small share is not nothing.
 * `percent` in words.rs has the same rule.
 */
function percent(part, all) {
  const value = (100 * part) / Math.max(1, all);
  if (part === 0) return "0 %";
  let steps = 10;
  for (let first = value; first < 1; first *= 10) steps *= 10;
  const rounded = Math.round(value * steps) / steps;
  return `${value < 1 ? rounded.toLocaleString("en", { maximumFractionDigits: 20 }) : rounded.toFixed(1)} %`;
}

/** Units of work that were done before the last call, and all of them. */
function resumed({ passes }) {
  const sum = (name) => passes.reduce((total, pass) => total + pass[name], 0);
  return { before: sum("resumed"), units: sum("units") };
}

function facts(pairs) {
  return el("dl", { class: "facts" }, ...pairs.filter(([, value]) => value).map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value))));
}

/** The name of a coordinate system with its code, which some names contain. */
function crsWords({ description, epsg }) {
  const name = description ?? "", code = `EPSG:${epsg}`;
  return epsg && !name.includes(code) ? `${name} (${code})` : name;
}

function fillRun(panel, run, page) {
  const { result } = run;
  const share = (part) => percent(part, result.points);
  const { before, units } = resumed(result), call = before ? ", last call" : "";
  const parts = [];
  const warnings = result.warnings ?? [];
  if (warnings.length) parts.push(el("section", { class: "block" }, el("h2", {}, counted(warnings.length, "warning")), ...warnings.map((text) => el("p", { class: "warning" }, text))));
  parts.push(el("section", { class: "block" }, el("h2", {}, "Figures"), facts([
    ["Points", shown(result.points)], ["Ground", share(result.counts.ground)], ["Noise", share(result.counts.low_noise + result.counts.high_noise)],
    ["Above the ground", share(result.counts.object)], [capital(THINGS.many), shown(result.objects)], ["Tiles", shown(result.tiles)],
    [`Wall time${call}`, seconds(result.seconds)], ["Speed", before ? null : `${shown(result.points / Math.max(1e-9, result.seconds) / 1e6, 2)} M points/s`],
    [`Peak memory${call}`, result.peak_resident_bytes && mebibytes(result.peak_resident_bytes)],
    ["Chainage", sectionWords(result)], ["Axis", lengthWords(run.axis.length_m)], ["Axis from", run.axis.source === "principal" ? "the principal axis of the points: it may not follow the road" : run.axis.source.replace("-", " ")], ["Coordinates in", unitWords()],
  ]), before ? el("p", { class: "note" }, `The last call resumed ${shown(before)} of ${shown(units)} units from earlier calls. Time and memory are those of the last call. It did not process all points, so no speed is given.`) : null, el("p", { class: "note" }, page.sample.sentence)));
  const longest = Math.max(1e-9, ...result.passes.map((pass) => pass.seconds));
  parts.push(el("section", { class: "block" }, el("h2", {}, "Passes"), el("div", { class: "bars" }, ...result.passes.flatMap((pass) => {
    const bar = el("i");
    bar.style.width = `${(100 * pass.seconds) / longest}%`;
    const resumed = pass.resumed ? `, ${pass.resumed} of ${pass.units} units done before` : "";
    return [el("span", { class: "name" }, pass.title), el("span", { class: "bar" }, bar), el("span", { class: "value" }, `${seconds(pass.seconds)}${resumed}`)];
  }))));
  parts.push(el("section", { class: "block" }, el("h2", {}, run.input.length === 1 ? "Input file" : `${shown(run.input.length)} input files`), el("dl", { class: "settings" },
    ...run.input.slice(0, MOST_FILES).flatMap((file) => [el("dt", {}, file.name), el("dd", {}, `${shown(file.points)} points, ${mebibytes(file.bytes)}`)]),
    ...(run.input.length > MOST_FILES ? [el("dt", {}, `${shown(run.input.length - MOST_FILES)} more`), el("dd", {}, "in report.json")] : []),
    el("dt", {}, "Coordinate system"), el("dd", {}, crsWords(run.crs)))));
  parts.push(el("section", { class: "block" }, el("h2", {}, "Settings"), ...Object.entries(run.configuration).map(([section, values]) =>
    el("details", {}, el("summary", {}, section), el("dl", { class: "settings" }, ...Object.entries(values).flatMap(([key, value]) => [el("dt", {}, key), el("dd", {}, typeof value === "string" ? value || "(none)" : JSON.stringify(value))]))))));
  parts.push(el("p", {}, run.program));
  panel.replaceChildren(...parts);
}
