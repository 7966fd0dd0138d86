// The table of objects: any columns, sorted, filtered by class and chainage, a hundred rows a page, as CSV.

const PAGE_ROWS = 100;

/** Whether the values of a column are words and lists, not numbers. */
function isText({ type }) { return type !== "count" && type !== "decimal"; }

class ObjectTable {
  /** `columns` have name, type, unit, places, definition; `values` is an array per column. */
  constructor(data, classes, on) {
    Object.assign(this, { ...data, classes, on, chosen: -1, page: 0, pageRows: PAGE_ROWS, sorted: 0, descending: false });
    this.count = this.values.length ? this.values[0].length : 0;
    this.rows = Array.from({ length: this.count }, (_, row) => row);
    this.ids = new Set((this.values[0] ?? []).map(String));
    const place = (name) => this.columns.findIndex((column) => column.name === name);
    this.classColumn = place("class");
    this.chainageColumn = place("chainage_m");
    this.order = this.displayed();
    this.fillHead();
    this.fillFilters();
    this.update();
  }

  /** The columns that have values, in the order of the page: what an object is and measures, then where it is. */
  displayed() {
    const group = ({ name, type }, at) => {
      if (at === 0 || at === this.classColumn) return 0;
      if (isText({ type })) return 5;
      if (isCoordinate(name)) return 4;
      if (/^(confidence|points)$/.test(name)) return 3;
      if (/^(chainage|offset)_m$/.test(name)) return 2;
      // How far an object is from the ground says less of it than its size.
      return /^base_/.test(name) ? 1.5 : 1;
    };
    const known = (at) => this.values[at].some((value) => value !== null && (at !== this.classColumn || value !== 0));
    const order = this.columns.map((_, at) => at).filter((at) => at === 0 || known(at));
    return order.sort((a, b) => group(this.columns[a], a) - group(this.columns[b], b) || a - b);
  }

  id(row) { return this.values[0][row]; }

  /** The name of an object on the page: its class, if it has one, and its id. */
  nameOf(row) {
    const code = this.codeOf(row);
    return `${code ? className(this.classes, code) : THINGS.one} ${this.id(row)}`;
  }

  /** A value as text with the digits of the other files; empty where it is missing. */
  text(column, row) {
    const value = this.values[column][row], { type, places } = this.columns[column];
    if (value === null || value === undefined) return "";
    if (Array.isArray(value)) return value.join(";");
    return type === "decimal" ? value.toFixed(places) : String(value);
  }

  fillHead() {
    const cells = this.order.map((at) => {
      const column = this.columns[at], words = isText(column) || at === this.classColumn;
      return el("th", { scope: "col", class: kindOf(column, words) }, el("button", { type: "button", title: `${column.name}: ${column.definition}`, onclick: () => this.sort(at) }, labelOf(column)));
    });
    $("table").tHead.replaceChildren(el("tr", {}, ...cells));
  }

  fillFilters() {
    const changed = () => { this.page = 0; this.update(); };
    this.filter = {};
    const parts = [];
    const codes = this.classColumn < 0 ? [] : [...new Set(this.values[this.classColumn])].sort((a, b) => a - b);
    if (codes.length > 1) {
      this.filter.kind = el("select", { onchange: changed, id: "filter-class" }, el("option", { value: "" }, "all"), ...codes.map((code) => el("option", { value: code }, className(this.classes, code))));
      parts.push(el("label", {}, "Class", this.filter.kind));
    }
    if (this.chainageColumn >= 0) {
      for (const [name, text] of [["from", "Chainage from"], ["to", "to (m)"]]) {
        this.filter[name] = el("input", { type: "number", step: "any", oninput: changed, id: `filter-${name}` });
        parts.push(el("label", {}, text, this.filter[name]));
      }
    }
    this.filter.text = el("input", { type: "search", oninput: changed, id: "filter-text", placeholder: codes.some((code) => code !== 0) ? "id, class, file" : "id, file", title: "A whole number finds the id. A class with a number finds that object. Other words find the beginning of a uid, and parts of the names of classes and files." });
    parts.push(el("label", {}, "Find", this.filter.text));
    parts.push(el("button", { type: "button", class: "plain", id: "csv", onclick: () => this.download() }, "Download CSV"));
    $("filters").replaceChildren(...parts);
    $("filters").addEventListener("submit", (event) => event.preventDefault());
  }

  clearFilters() {
    for (const field of Object.values(this.filter)) field.value = "";
    this.update();
  }

  find(text) {
    this.filter.text.value = text;
    this.page = 0;
    this.update();
  }

  sort(column) {
    this.descending = column === this.sorted && !this.descending;
    this.sorted = column;
    this.page = 0;
    this.update();
  }

  codeOf(row) { return this.classColumn < 0 ? 0 : this.values[this.classColumn][row]; }

  /** Whether a row passes the filters and the legend. */
  passes(row) {
    if (this.on.isHidden(this.codeOf(row))) return false;
    const { kind, from, to, text } = this.filter;
    if (kind?.value && String(this.values[this.classColumn][row]) !== kind.value) return false;
    const station = this.chainageColumn >= 0 ? this.values[this.chainageColumn][row] : null;
    if (from?.value && !(station >= Number(from.value))) return false;
    if (to?.value && !(station <= Number(to.value))) return false;
    return this.matches(row, text.value.trim().replace(/\s+/g, " ").toLowerCase());
  }

  /**
   * Whether the text to find is in a row. A whole number is an id. It is searched in names of files only if no
   * object has this id.
   */
  matches(row, wanted) {
    if (!wanted) return true;
    if (this.ids.has(wanted)) return String(this.id(row)) === wanted;
    if (this.nameOf(row).toLowerCase() === wanted) return true;
    if (this.classColumn >= 0 && this.codeOf(row) !== 0 && className(this.classes, this.codeOf(row)).toLowerCase().includes(wanted)) return true;
    return this.columns.some(({ type }, at) => {
      if (type === "text") return !/^\d+$/.test(wanted) && this.text(at, row).toLowerCase().startsWith(wanted);
      return type === "texts" && this.values[at][row]?.some((name) => name.toLowerCase().includes(wanted));
    });
  }

  update() {
    const values = this.values[this.sorted], sign = this.descending ? -1 : 1;
    const words = this.columns[this.sorted] && isText(this.columns[this.sorted]);
    const empty = (value) => value === null || value === undefined;
    this.rows = Array.from({ length: this.count }, (_, row) => row).filter((row) => this.passes(row));
    this.rows.sort((a, b) => {
      const one = values[a], two = values[b];
      // Missing values are last in both directions; equal ones stay in the order of ids.
      if (empty(one) || empty(two)) return empty(one) - empty(two) || a - b;
      const order = words ? String(one).localeCompare(String(two)) : one - two;
      return order * sign || a - b;
    });
    this.show();
    this.on.filtered(this.rows);
  }

  show() {
    const pages = Math.max(1, Math.ceil(this.rows.length / this.pageRows));
    this.page = Math.min(this.page, pages - 1);
    const first = this.page * this.pageRows, rows = this.rows.slice(first, first + this.pageRows);
    [...$("table").tHead.rows[0].cells].forEach((cell, at) => {
      if (this.order[at] === this.sorted) cell.setAttribute("aria-sort", this.descending ? "descending" : "ascending");
      else cell.removeAttribute("aria-sort");
    });
    $("table").tBodies[0].replaceChildren(...rows.map((row) => this.row(row)));
    if (rows.length === 0) {
      const words = this.count ? `No ${THINGS.one} passes the filters.` : `The drive has no ${THINGS.many}.`;
      $("table").tBodies[0].append(el("tr", {}, el("td", { colspan: this.order.length, class: "empty" }, el("div", {}, words))));
    }
    const turn = (by, text) => pages === 1 ? null : el("button", { type: "button", class: "plain", disabled: this.page + by < 0 || this.page + by >= pages, onclick: () => { this.page += by; this.show(); } }, text);
    const range = this.rows.length ? `${shown(first + 1)} to ${shown(first + rows.length)} of ${shown(this.rows.length)}` : "0 rows";
    const hidden = Array.from({ length: this.count }, (_, row) => row).filter((row) => this.on.isHidden(this.codeOf(row))).length;
    const all = this.rows.length < this.count ? ` (${shown(this.count)} in all${hidden ? `, ${shown(hidden)} hidden in the legend` : ""})` : "";
    const show = hidden ? el("button", { type: "button", class: "plain", onclick: () => this.on.showAll() }, "Show all") : null;
    $("pager").replaceChildren(el("span", { role: "status" }, range + all), el("div", {}, ...[show, turn(-1, "Previous"), turn(1, "Next")].filter(Boolean)), this.leftOut());
  }

  /** What a printed page has no room for. */
  leftOut() {
    const names = this.columns.filter((column, at) => !this.order.includes(at) || isExtra(column)).map(({ name }) => name);
    return names.length ? el("span", { class: "printed" }, `Not printed: the columns ${names.join(", ")}. objects.csv has them.`) : null;
  }

  /** All rows on one page while it is printed. */
  print(isPrinted) {
    if (isPrinted) this.pageBefore = this.page;
    this.pageRows = isPrinted ? Math.max(1, this.rows.length) : PAGE_ROWS;
    this.page = isPrinted ? 0 : this.pageBefore ?? 0;
    this.show();
  }

  row(row) {
    const cells = this.order.map((at) => {
      const column = this.columns[at], text = this.text(at, row);
      if (at === 0) return el("td", {}, el("button", { type: "button", "aria-label": `${capital(THINGS.one)} ${text}: fly to it` }, text));
      if (at === this.classColumn) return el("td", { class: "words" }, dot(classColour(this.values[at][row])), className(this.classes, this.values[at][row]));
      const words = isText(column);
      return el("td", { class: kindOf(column, words), title: words ? text : null }, text);
    });
    return el("tr", { "data-row": row, "aria-selected": row === this.chosen ? "true" : "false", onclick: () => this.on.choose(row) }, ...cells);
  }

  /** Marks a row, and turns to its page. */
  choose(row) {
    this.chosen = row;
    const at = this.rows.indexOf(row);
    const page = at < 0 ? this.page : Math.floor(at / this.pageRows);
    if (page !== this.page) { this.page = page; this.show(); }
    for (const node of $("table").tBodies[0].rows) node.setAttribute("aria-selected", String(node.dataset.row === String(row)));
    const node = $("table").querySelector('tr[aria-selected="true"]');
    const frame = $("table-scroll");
    if (node && frame.scrollHeight > frame.clientHeight) {
      const top = node.offsetTop - $("table").tHead.offsetHeight, bottom = node.offsetTop + node.offsetHeight;
      if (top < frame.scrollTop) frame.scrollTop = top;
      else if (bottom > frame.scrollTop + frame.clientHeight) frame.scrollTop = bottom - frame.clientHeight + 8;
    }
  }

  /** The rows that pass the filters, in the order of the table, after RFC 4180 as objects.csv is. */
  csv() {
    const quoted = (text) => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    // As in objects.csv, so that a name with a semicolon is one name.
    const encoded = (item) => String(item).replaceAll("%", "%25").replaceAll(";", "%3B");
    const listed = (items) => items.map(encoded).join(";");
    const cell = (row, at) => (Array.isArray(this.values[at][row]) ? listed(this.values[at][row]) : this.text(at, row));
    const lines = this.rows.map((row) => this.columns.map((_, at) => quoted(cell(row, at))).join(","));
    return [this.columns.map((column) => column.name).join(","), ...lines, ""].join("\n");
  }

  download() {
    const link = el("a", { href: URL.createObjectURL(new Blob([this.csv()], { type: "text/csv" })), download: "objects.csv" });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }
}

const isCoordinate = (name) => /(^|_)[xyz]$/.test(name);

/** Whether a printed page leaves a column out. */
const isExtra = (column) => isText(column) || isCoordinate(column.name);

/** How the cells of a column look: words are on the left, and a printed page leaves out what does not fit. */
function kindOf(column, words) {
  return [words && "words", isExtra(column) && "extra"].filter(Boolean).join(" ") || null;
}

/** The unit of the values of a column. Coordinates have that of the input. */
function unitOf({ name, unit }) { return unit === "input" ? UNITS[/z$/.test(name) ? 1 : 0] : unit; }

/** The name of a column for a person, with its unit. */
function labelOf(column) {
  const unit = unitOf(column), name = column.unit === "input" ? column.name : column.name.replace(/_(m2|m|deg)$/, "");
  return name.replaceAll("_", " ") + (unit ? ` (${unit})` : "");
}

function dot(colour) {
  const node = el("span", { class: "dot", "aria-hidden": "true" });
  node.style.background = colour;
  return node;
}

function className(classes, code) {
  return classes[code] ?? `class ${code}`;
}
