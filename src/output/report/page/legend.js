// How points are coloured, and which of them are shown: modes, and a switch for each class in every mode.

const MODES = [["object", "Object"], ["class", "Class"], ["height", "Height"], ["intensity", "Intensity"]];

class Legend {
  /**
   * `classified`: whether objects have classes. `points`: whether points are shown, and not the plan alone.
   * `on.recoloured()` is called when the mode changes, and `on.switched()` when something is shown or hidden.
   */
  constructor(table, classified, points, on) {
    Object.assign(this, { table, classified, points, on, hidden: new Set(), mode: classified ? "class" : "object", switches: new Map() });
    this.count = new Map();
    for (const code of classified ? table.values[table.classColumn] : []) this.count.set(code, (this.count.get(code) ?? 0) + 1);
    if (points) this.fillModes();
  }

  fillModes() {
    $("modes").append(...MODES.filter(([mode]) => this.classified || mode !== "class").map(([mode, text]) => {
      const input = el("input", { type: "radio", name: "mode", value: mode, id: `mode-${mode}`, onchange: () => { this.mode = mode; this.on.recoloured(); } });
      input.checked = mode === this.mode;
      return el("label", {}, input, el("span", {}, mode === "object" ? capital(THINGS.one) : text));
    }));
  }

  /** Fills the legend of the mode. Only what the mode colours has a dot. */
  fill(theme) {
    const { mode } = this, parts = [];
    this.switches.clear();
    if (!this.points) {
      if (!this.classified) return;
    } else if (mode === "height" || mode === "intensity") {
      const bar = el("i");
      bar.style.background = `linear-gradient(90deg, ${(mode === "height" ? HEIGHT_RAMP : INTENSITY_RAMP[theme]).join(", ")})`;
      parts.push(el("span", { class: "ramp" }, mode === "height" ? "ground" : "low", bar, mode === "height" ? `${HIGHEST_M} m over it` : "high"));
    } else if (mode === "object" && this.table.count > 0) {
      const many = dot("");
      many.style.background = `conic-gradient(${[0, 1, 2, 3, 4, 5].map((number) => hueColour(3 * number)).join(", ")})`;
      parts.push(el("span", { class: "ramp" }, many, `a colour for each ${THINGS.one}`));
    }
    for (const code of [...this.count.keys()].sort((a, b) => a - b)) parts.push(this.switchFor(code, mode === "class" ? classColour(code) : null, className(this.table.classes, code), this.count.get(code)));
    if (this.points) {
      const plain = mode === "object" || mode === "class";
      parts.push(this.switchFor("ground", plain ? GROUND_COLOUR[theme] : null, "ground"), this.switchFor("loose", plain ? LOOSE_COLOUR[theme] : null, this.table.count ? `no ${THINGS.one}` : "above the ground"));
    }
    this.all = el("button", { type: "button", class: "all", id: "show-all", onclick: () => { this.showAll(); $("legend").querySelector("[aria-pressed]").focus(); } }, "Show all");
    $("legend").replaceChildren(...parts, this.all);
    this.update();
  }

  switchFor(what, colour, text, count) {
    const press = () => {
      if (!this.hidden.delete(what)) this.hidden.add(what);
      this.update();
      this.on.switched();
    };
    const node = el("button", { type: "button", title: `Show or hide: ${text}`, onclick: press }, colour && dot(colour), text, count === undefined ? null : el("small", {}, shown(count)));
    this.switches.set(what, node);
    return node;
  }

  /** The switches stay the same elements, so that the keyboard keeps its place. */
  update() {
    for (const [what, node] of this.switches) node.setAttribute("aria-pressed", String(!this.hidden.has(what)));
    if (this.all) this.all.hidden = this.hidden.size === 0;
  }

  showAll() {
    this.hidden.clear();
    this.update();
    this.on.switched();
  }
}
