// Numbers of objects by class, and a histogram of any column for each class.

const SVG = "http://www.w3.org/2000/svg";

function svg(tag, attributes, ...children) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

/** Columns that measure an object, and not where it is. */
function measures(table) {
  const place = /^(id|class|confidence|(min|max|mean|base|centroid|ground)?_?[xyz]|chainage_m|offset_m|.*azimuth.*)$/;
  const order = [/^height/, /^dbh_m/, /^crown_diameter/, /^points$/];
  const rank = (at) => { const found = order.findIndex((name) => name.test(table.columns[at].name)); return found < 0 ? 99 : found; };
  const numbers = table.columns.map((_, at) => at).filter((at) => ["decimal", "count"].includes(table.columns[at].type) && !place.test(table.columns[at].name));
  return numbers.filter((at) => table.values[at].some((value) => value !== null)).sort((a, b) => rank(a) - rank(b) || a - b);
}

function fillStatistics(panel, table) {
  if (table.count === 0) { panel.replaceChildren(el("p", { class: "empty" }, `The drive has no ${THINGS.many}.`)); return; }
  const codes = table.classColumn < 0 ? table.values[0].map(() => 0) : table.values[table.classColumn];
  const rowsOf = new Map();
  codes.forEach((code, row) => { if (!rowsOf.has(code)) rowsOf.set(code, []); rowsOf.get(code).push(row); });
  const classes = [...rowsOf.keys()].sort((a, b) => a - b);
  const most = Math.max(...classes.map((code) => rowsOf.get(code).length));
  const bars = classes.flatMap((code) => {
    const bar = el("i");
    bar.style.width = `${(100 * rowsOf.get(code).length) / most}%`;
    bar.style.background = classColour(code);
    return [el("span", { class: "name" }, dot(classColour(code)), className(table.classes, code)), el("span", { class: "bar" }, bar), el("span", { class: "value" }, shown(rowsOf.get(code).length))];
  });
  const choices = measures(table);
  const charts = el("div", { class: "charts" });
  const select = el("select", { id: "measure", onchange: () => draw(Number(select.value)) }, ...choices.map((at) => el("option", { value: at }, labelOf(table.columns[at]))));
  const note = el("p", { class: "note" });
  const draw = (at) => {
    const column = table.columns[at];
    note.textContent = column.definition;
    const shownClasses = classes.filter((code) => rowsOf.get(code).some((row) => table.values[at][row] !== null));
    const group = (code) => (classified ? { name: className(table.classes, code), colour: classColour(code) } : { name: `all ${THINGS.many}`, colour: "var(--accent)" });
    charts.replaceChildren(...shownClasses.map((code) => histogram(column, rowsOf.get(code).map((row) => table.values[at][row]).filter((value) => value !== null), group(code))));
  };
  // A method without classes has one group, of all.
  const classified = classes.some((code) => code !== 0);
  panel.replaceChildren(
    ...(classified ? [el("section", { class: "block" }, el("h2", {}, `${capital(THINGS.many)} by class`), el("div", { class: "bars" }, ...bars))] : []),
    el("section", { class: "block" }, el("h2", {}, classified ? "Distribution by class" : `Distribution of the ${THINGS.many}`), el("p", {}, el("label", { for: "measure" }, "Column "), select), note, charts),
  );
  if (choices.length) draw(choices[0]);
}

/** Values from which on a histogram leaves the highest hundredth beyond its axis. Of fewer it would hide the largest. */
const MANY_VALUES = 100;
/** Upper ends of axes, times a power of ten. */
const ENDS = [1, 1.5, 2, 3, 4, 5, 6, 8, 10];

/** The middle of sorted values: the mean of the middle two, if their number is even. */
function median(sorted) {
  const half = sorted.length >> 1;
  return sorted.length % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

/** The upper end of an axis: a round number that is not below any value, or not below 99 of 100 of many. */
function upperEnd(sorted) {
  const last = sorted.length - 1, isMany = sorted.length >= MANY_VALUES;
  const least = Math.max(sorted[isMany ? Math.floor(last * 0.99) : last], 1e-6), end = niceStep(least, ENDS);
  return end < least ? niceStep(end * 1.01, ENDS) : end;
}

/** About the width of a text in a histogram: its letters are 10 px high. */
const widthOf = (words) => 5.8 * words.length;

/** A histogram of values with their name and colour. */
function histogram(column, values, { name, colour }) {
  const sorted = [...values].sort((a, b) => a - b), high = upperEnd(sorted), low = Math.min(0, sorted[0]);
  const bins = 18, width = 210, height = 94, left = 6, top = 16, bottom = 76;
  const counts = new Array(bins).fill(0);
  for (const value of values) counts[Math.max(0, Math.min(bins - 1, Math.floor(((value - low) / (high - low || 1)) * bins)))]++;
  const beyond = values.filter((value) => value > high).length;
  const most = Math.max(1, ...counts), step = (width - 2 * left) / bins;
  const unit = unitOf(column) ? ` ${unitOf(column)}` : "", digits = column.places && Math.min(2, column.places);
  const half = `median ${shown(median(sorted), column.type === "count" ? undefined : digits)}${unit}`;
  const more = beyond ? `The last bar has ${shown(beyond)} above ${shown(high)}${unit}, to ${shown(sorted.at(-1), digits)}${unit}.` : "";
  const text = (x, y, anchor, words) => svg("text", { x, y, "text-anchor": anchor }, words);
  const [first, middle, last] = [shown(low), shown((low + high) / 2), `${shown(high)}${unit}`];
  // The label in the middle goes where it would touch another one.
  const beside = width / 2 - left - widthOf(middle) / 2 - 6, fits = Math.max(widthOf(first), widthOf(last)) <= beside;
  const chart = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${name}: ${counted(values.length, THINGS.one)}, ${half}. ${more}` },
    ...counts.map((count, at) => {
      const tall = (count / most) * (bottom - top);
      const bar = svg("rect", { x: left + at * step + 0.5, y: bottom - tall, width: step - 1, height: tall, rx: 1.5 });
      bar.style.fill = colour;
      if (at === bins - 1 && beyond) bar.classList.add("beyond");
      return bar;
    }),
    svg("line", { x1: left, x2: width - left, y1: top, y2: top, class: "scale" }), text(left, top - 4, "start", counted(most, THINGS.one)),
    svg("line", { x1: left, x2: width - left, y1: bottom, y2: bottom }),
    text(left, bottom + 13, "start", first), ...(fits ? [text(width / 2, bottom + 13, "middle", middle)] : []), text(width - left, bottom + 13, "end", last));
  return el("figure", {}, el("figcaption", {}, dot(colour), name, el("small", {}, half)), chart, more ? el("p", { class: "more" }, more) : null);
}
