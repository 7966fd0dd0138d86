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
    charts.replaceChildren(...shownClasses.map((code) => histogram(table, column, rowsOf.get(code).map((row) => table.values[at][row]).filter((value) => value !== null), code)));
  };
  panel.replaceChildren(
    el("section", { class: "block" }, el("h2", {}, `${capital(THINGS.many)} by class`), el("div", { class: "bars" }, ...bars)),
    el("section", { class: "block" }, el("h2", {}, "Distribution by class"), el("p", {}, el("label", { for: "measure" }, "Column "), select), note, charts),
  );
  if (choices.length) draw(choices[0]);
}

function histogram(table, column, values, code) {
  // From 0 to a round number that a hundredth of the values may exceed; these are in the last bar.
  const sorted = [...values].sort((a, b) => a - b);
  const high = niceStep(Math.max(sorted[Math.floor((sorted.length - 1) * 0.99)], 1e-6), [1, 1.5, 2, 3, 4, 5, 6, 8, 10]);
  const low = Math.min(0, sorted[0]);
  const bins = 18, width = 210, height = 94, left = 6, top = 16, bottom = 76;
  const counts = new Array(bins).fill(0);
  for (const value of values) counts[Math.max(0, Math.min(bins - 1, Math.floor(((value - low) / (high - low || 1)) * bins)))]++;
  const beyond = values.filter((value) => value > high).length;
  const most = Math.max(1, ...counts), step = (width - 2 * left) / bins;
  const middle = sorted[(sorted.length - 1) >> 1];
  const name = className(table.classes, code), unit = unitOf(column) ? ` ${unitOf(column)}` : "";
  const median = `median ${shown(middle, column.places && Math.min(2, column.places))}${unit}`;
  const text = (x, y, anchor, words) => svg("text", { x, y, "text-anchor": anchor }, words);
  const more = beyond ? `; the last bar has also the ${shown(beyond)} above ${shown(high)}${unit}` : "";
  const chart = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${name}: ${counted(values.length, THINGS.one)}, ${median}${more}` },
    ...counts.map((count, at) => {
      const tall = (count / most) * (bottom - top);
      const bar = svg("rect", { x: left + at * step + 0.5, y: bottom - tall, width: step - 1, height: tall, rx: 1.5, fill: classColour(code) });
      if (at === bins - 1 && beyond) bar.classList.add("beyond");
      return bar;
    }),
    svg("line", { x1: left, x2: width - left, y1: top, y2: top, class: "scale" }), text(left, top - 4, "start", counted(most, THINGS.one)),
    svg("line", { x1: left, x2: width - left, y1: bottom, y2: bottom }),
    text(left, bottom + 13, "start", shown(low)), text(width / 2, bottom + 13, "middle", shown((low + high) / 2)),
    text(width - left, bottom + 13, "end", `${shown(high)}${unit}${beyond ? " and more" : ""}`));
  return el("figure", {}, el("figcaption", {}, dot(classColour(code)), name, el("small", {}, median)), chart);
}
