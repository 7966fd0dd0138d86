// Joins the parts of the page: what is chosen, how points are coloured, where the eye is.

/** Objects up to which the plan is drawn with every picture. */
const FEW_OUTLINES = 1500;

class App {
  constructor() {
    this.page = json("data-page");
    this.run = json("data-run");
    this.classes = this.page.classes;
    this.chosen = -1;
    this.theme = {};
    fillHead(this.page, this.run);
    this.showTab = bindTabs();
    bindSkip(() => this.showTab($("tab-table")));
    this.unfold = bindFold();
    bindTheme((theme) => {
      this.theme = theme;
      if (this.legend) this.recolour();
      this.plan?.draw();
    });
    const { warnings = [] } = this.run.result;
    if (warnings.length) notice([el("b", {}, counted(warnings.length, "warning")), `: ${warnings[0]}`], () => this.showWarnings());
  }

  showWarnings() {
    this.showTab($("tab-run"));
    $("run-panel").scrollTop = 0;
    $("run-panel").scrollIntoView();
    $("run-panel").focus({ preventScroll: true });
  }

  async start() {
    fillRun($("run-panel"), this.run, this.page);
    const data = JSON.parse(new TextDecoder().decode(await inflated("data-table")));
    this.outlines = data.outlines;
    this.axis = new Axis(this.page.axis, this.run.result.section, this.run.axis.length_m);
    this.table = new ObjectTable(data, this.classes, { choose: (row) => { this.unfold(false); this.choose(row, true); }, filtered: (rows) => this.filtered(rows), isHidden: (code) => this.legend?.hidden.has(code) ?? false, showAll: () => this.legend.showAll() });
    this.rowOf = new Map(this.table.values.length ? this.table.values[0].map((id, row) => [id, row]) : []);
    fillStatistics($("classes-panel"), this.table);
    this.plan = new Plan($("plan"), this.axis, this.outlines, this.run.tiles, { choose: (row) => this.choose(row, row >= 0), colour: (row) => this.colourOf(row) });
    this.plan.shown = (row) => this.isShown(row);
    this.classified = this.table.classColumn >= 0 && this.table.values[this.table.classColumn].some((code) => code !== 0);
    this.stations();
    try {
      await this.startScene();
    } catch (error) {
      this.goWithoutScene(error);
    }
    this.legend = new Legend(this.table, this.classified, Boolean(this.scene), { recoloured: () => this.recolour(), switched: () => this.table.update() });
    this.bind();
    this.bindCard();
    this.recolour();
    // The legend is filled: it takes a part of the view.
    if (this.scene) this.camera.take(this.poses.first());
    const sizes = new ResizeObserver(() => { this.plan.draw(); this.render(); });
    for (const id of ["view", "plan"]) sizes.observe($(id));
    this.followLink();
    addEventListener("hashchange", () => this.followLink());
    this.bindPrint();
    document.documentElement.dataset.ready = "true";
    if (this.scene) await this.startStream();
  }

  async startScene() {
    const { sample } = this.page;
    const points = this.points = readSample(await inflated("data-points"), sample.points, sample.step_m);
    this.ground = new Ground(points);
    this.camera = new Camera(this.radius(points));
    this.scene = new Scene($("scene"), points, this.measure(points));
    this.scene.axisLines = this.axis.stretches.map(({ x, y }) => Float32Array.from(x.flatMap((value, at) => [value, y[at], this.ground.height(value, y[at]) + 0.1])));
    this.poses = new Poses(points, this.ground, this.axis, this.plan, this.camera, $("scene"));
    $("scene-message").hidden = points.count > 0;
    if (points.count === 0) $("scene-message").textContent = "The drive has no points to show.";
  }

  /** The plan takes the place of the 3D view; controls that need the view go. */
  goWithoutScene(error) {
    this.scene = null;
    this.camera = null;
    document.documentElement.dataset.scene = "none";
    $("scene-message").textContent = `There is no 3D view: ${error.message}. Everything else works: the plan, the table, the statistics.`;
    this.plan.fit();
    $("scene-message").hidden = false;
  }

  /** Distance within which all but single stray points are. */
  radius(points) {
    const far = [];
    for (let at = 0; at < points.count; at += 1 + (points.count >> 12)) far.push(Math.hypot(points.places[3 * at], points.places[3 * at + 1]));
    far.sort((a, b) => a - b);
    return Math.max(10, far[Math.floor(0.98 * (far.length - 1))] ?? 10);
  }

  /** Streams all points, if the page comes from `chainage view` and the run wrote them. */
  async startStream() {
    try {
      const fully = this.fullSpacings();
      this.stream = await Stream.open(this.page, { add: (points) => new Cloud(this.scene.gl, points, fully), changed: () => this.render() });
      this.render();
    } catch (error) {
      $("detail").textContent = `No further points: ${error.message}`;
      $("detail").hidden = false;
    }
  }

  /** Draws the streamed points that the view needs and that are here. */
  showDetail() {
    const { stream, scene } = this, canvas = $("scene");
    if (!stream) return;
    const scale = scene.targets.scale ?? 1;
    scene.stream(stream.update(this.camera, canvas.clientWidth * scale, canvas.clientHeight * scale), stream.octree);
    const painted = scene.paint(this.colour, this.painted);
    if (!painted) this.render();
    $("detail").textContent = stream.words;
    $("detail").hidden = false;
    document.documentElement.dataset.detail = String(stream.complete && painted);
  }

  /** How far apart the points of a key are if all are shown, in metres: denser than the sample by what it leaves out. */
  fullSpacings() {
    const { counts } = this.run.result, { table } = this;
    const column = table.columns.findIndex(({ name }) => name === "points");
    const inObjects = column < 0 ? 0 : table.values[column].reduce((sum, points) => sum + points, 0);
    return (key) => {
      const all = key === 0 ? counts.ground : key === 1 ? counts.object - inObjects : table.values[column]?.[this.rowOf.get(key - 1)];
      if (!all) return 0.03;
      return this.spacings(key) * Math.sqrt(Math.min(1, (this.sampled.get(key) ?? 1) / all));
    };
  }

  /** Finds the box of each object, and returns how far apart the points of a key are, in metres. */
  measure(points) {
    this.boxes = Array.from({ length: this.table.count }, () => null);
    const counts = (this.sampled = new Map());
    for (let at = 0; at < points.count; at++) {
      const key = points.keys[at];
      counts.set(key, (counts.get(key) ?? 0) + 1);
      const row = key < 2 ? undefined : this.rowOf.get(key - 1);
      if (row === undefined) continue;
      const box = (this.boxes[row] ??= [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity]);
      for (let axis = 0; axis < 3; axis++) {
        const value = points.places[3 * at + axis];
        if (value < box[axis]) box[axis] = value;
        if (value > box[axis + 3]) box[axis + 3] = value;
      }
    }
    const ground = 0.8 * Math.sqrt(this.ground.area() / Math.max(1, counts.get(0) ?? 1));
    return (this.spacings = (key) => {
      const box = key < 2 ? null : this.boxes[this.rowOf.get(key - 1)];
      if (!box) return Math.min(key === 0 ? 0.4 : 0.12, Math.max(0.03, ground));
      const [dx, dy, dz] = [0, 1, 2].map((axis) => box[axis + 3] - box[axis]);
      return Math.min(1, Math.max(0.03, 0.75 * Math.sqrt(((dx + dy) * dz + 0.5 * dx * dy) / counts.get(key))));
    });
  }

  classOf(row) { return row >= 0 && this.table.classColumn >= 0 ? this.table.values[this.table.classColumn][row] : 0; }

  /** Colour of an object: that of its class, or its own where the method has no classes. */
  colourOf(row) { return this.classified ? classColour(this.classOf(row)) : hueColour(this.table.id(row) + 1); }

  isShown(row, code = this.classOf(row)) { return !this.legend?.hidden.has(code) && (!this.passing || this.passing.has(row)); }

  /** Whether the points of a key are shown. */
  showsKey(key) {
    if (key === 1) return !this.legend.hidden.has("loose");
    const row = this.rowOf.get(key - 1);
    return row === undefined || this.isShown(row);
  }

  /** Called when the filters or the legend change the rows of the table. Other objects are hidden and not chosen. */
  filtered(rows) {
    this.passing = rows.length === this.table?.count || !this.table ? null : new Set(rows);
    if (!this.legend) return;
    if (this.chosen >= 0 && !this.isShown(this.chosen)) this.choose(-1);
    this.paint();
  }

  /** Called when the mode or the theme changes. */
  recolour() {
    this.legend.fill(this.theme.name);
    this.paint();
  }

  /** Colours every point for the mode: the sample now, and streamed points while pictures are drawn. */
  paint() {
    const { theme, ground, legend: { mode, hidden } } = this;
    this.plan.draw();
    if (!this.scene) return;
    this.colour = colouring({ mode, theme, ground, hidden, rowOf: (id) => this.rowOf.get(id), classOf: (row) => this.classOf(row), isShown: (row, code) => this.isShown(row, code) });
    this.painted = (this.painted ?? 0) + 1;
    this.scene.paint(this.colour, this.painted);
    this.render();
  }

  /** Draws at the next frame. */
  render(moving = false) {
    if (!this.scene) return;
    this.wanted = { moving: moving || (this.wanted?.moving ?? false) };
    this.frame ??= requestAnimationFrame(() => this.drawNow(this.wanted.moving));
  }

  /** Draws at once; fewer points if it has to be fast. */
  drawNow(fast) {
    cancelAnimationFrame(this.frame);
    this.frame = this.wanted = null;
    this.scene.chosen = this.chosen >= 0 ? this.table.id(this.chosen) + 1 : 0;
    this.showDetail();
    this.scene.draw(this.camera, this.theme, this.chosenBox(), fast);
    this.placeTag();
    const [x, y] = this.camera.eye();
    this.plan.eye = { x, y, yaw: this.camera.yaw };
    clearTimeout(this.still);
    if (fast) this.still = setTimeout(() => this.render(), 160);
    // Thousands of outlines would slow the drive down: then the plan follows when the eye rests.
    if (!fast || this.table.count < FEW_OUTLINES) this.plan.draw();
  }

  /**
   * A printed page has all rows and all settings. It is printed before the next frame, so the view is drawn at once.
   * The theme has its own listener, which comes first.
   */
  bindPrint() {
    let closed = [];
    addEventListener("beforeprint", () => {
      closed = [...document.querySelectorAll("details:not([open])")];
      for (const details of closed) details.open = true;
      this.table.print(true);
      if (this.scene) this.drawNow(false);
    });
    addEventListener("afterprint", () => {
      for (const details of closed) details.open = false;
      this.table.print(false);
      this.render();
    });
  }

  /** The edges of the box of the chosen object. */
  chosenBox() {
    const box = this.boxes?.[this.chosen];
    if (!box) return null;
    const low = box.slice(0, 3).map((value) => value - 0.1), high = box.slice(3).map((value) => value + 0.1);
    const corner = (bits) => [0, 1, 2].map((axis) => (bits & (1 << axis) ? high[axis] : low[axis]));
    const edges = [];
    for (let bits = 0; bits < 8; bits++) for (let axis = 0; axis < 3; axis++) if (!(bits & (1 << axis))) edges.push(...corner(bits), ...corner(bits | (1 << axis)));
    return Float32Array.from(edges);
  }

  placeTag() {
    const box = this.boxes?.[this.chosen], tag = $("tag"), { clientWidth: width, clientHeight: height } = $("scene");
    const place = box && this.camera.project([(box[0] + box[3]) / 2, (box[1] + box[4]) / 2, box[5] + 0.3], width, height);
    tag.hidden = !place || place[0] < 0 || place[1] < 0 || place[0] > width || place[1] > height;
    if (tag.hidden) return;
    tag.textContent = this.table.nameOf(this.chosen);
    // Within the view and below the controls.
    const half = tag.offsetWidth / 2 + 4, least = $("controls").getBoundingClientRect().bottom - $("scene").getBoundingClientRect().top + 4;
    const x = Math.min(width - half, Math.max(half, place[0])), y = Math.max(least, place[1] - 1.3 * tag.offsetHeight);
    tag.style.transform = `translate(${x}px, ${y}px) translate(-50%, 0)`;
  }

  choose(row, fly = false) {
    this.chosen = row;
    const card = $("card");
    card.hidden = row < 0;
    if (row >= 0) {
      const { table } = this;
      const title = el("h2", {}, table.nameOf(row));
      const close = el("button", { type: "button", class: "icon", "aria-label": "Close", onclick: () => this.choose(-1) }, "×");
      const values = table.order.flatMap((at) => {
        const column = table.columns[at], text = table.text(at, row);
        if (at === 0 || at === table.classColumn || text === "") return [];
        return [el("dt", { title: column.definition }, labelOf(column)), el("dd", {}, text)];
      });
      card.replaceChildren(el("header", {}, dot(this.colourOf(row)), title, close), el("dl", {}, ...values));
      const box = this.boxes?.[row];
      if (fly && box && this.camera) this.fly(this.poses.of(box, this.table.id(row) + 1, card, (key) => this.showsKey(key)));
      const outline = this.outlines[row];
      if (outline?.length) this.plan.show(outline[0], outline[1]);
    }
    writeLink(row < 0 ? null : linkName(this.table, row));
    this.table.choose(row);
    this.plan.chosen = row;
    this.plan.draw();
    this.render();
  }

  /** Chooses the object that the address names, and shows it if it is hidden. */
  followLink() {
    const name = readLink(), row = name === null ? -1 : linkedRow(this.table, name);
    if (name === null || row === this.chosen) return;
    if (row < 0) { notice([`This report has no ${THINGS.one} ${name}.`]); return; }
    if (!this.isShown(row)) {
      this.table.clearFilters();
      this.legend.showAll();
    }
    this.choose(row, true);
  }

  fly(pose) {
    this.stop();
    if (!this.camera) return;
    const from = this.camera.pose(), calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (calm) { this.camera.take(pose); this.render(); return; }
    const began = performance.now();
    const flight = this.flight = () => {
      if (this.flight !== flight) return;
      const share = Math.min(1, (performance.now() - began) / 750);
      this.camera.between(from, pose, share);
      this.render(share < 1);
      if (share < 1) requestAnimationFrame(flight); else this.flight = null;
    };
    flight();
  }

  /** Ends flights and drives. */
  stop() {
    this.flight = null;
    this.driving = false;
    $("play").setAttribute("aria-pressed", "false");
  }

  stations() {
    const slider = $("chainage");
    slider.min = this.axis.from;
    slider.max = this.axis.to;
    slider.step = Math.max(0.1, (this.axis.to - this.axis.from) / 4000).toFixed(2);
    slider.value = this.axis.from;
    this.tellStation(Number(slider.value));
  }

  tellStation(s) {
    const { section } = this.run.result;
    const text = section ? `${shown(s, 0)} m (${shown(section.from_m, 0)} to ${shown(section.to_m, 0)} m)` : `${shown(s, 0)} of ${shown(this.axis.to, 0)} m`;
    $("station").textContent = text;
    $("chainage").setAttribute("aria-valuetext", text);
  }

  /** Goes to a chainage; `glide` moves there from where the eye is. */
  driveTo(s, glide = false) {
    const at = Math.min(this.axis.to, Math.max(this.axis.from, s));
    $("chainage").value = at;
    this.tellStation(at);
    this.station = at;
    if (!this.camera) {
      const { x, y, heading } = this.axis.at(at);
      this.plan.eye = { x, y, yaw: heading };
      this.plan.draw();
      return;
    }
    if (glide) { this.fly(this.poses.drive(at)); return; }
    this.camera.take(this.poses.drive(at));
    this.render(true);
  }

  play() {
    const drive = !this.driving;
    this.stop();
    if (!drive) return;
    this.driving = true;
    $("play").setAttribute("aria-pressed", "true");
    let s = this.station ?? this.axis.from, last = performance.now();
    if (s >= this.axis.to - 0.5) s = this.axis.from;
    const step = (now) => {
      if (!this.driving) return;
      // 10 m/s, a car in a street; a late frame does not jump.
      s += 10 * Math.min(0.1, (now - last) / 1000);
      last = now;
      this.driveTo(s);
      if (s < this.axis.to) requestAnimationFrame(step); else this.stop();
    };
    requestAnimationFrame(step);
  }

  /** The next object along the axis. */
  step(by) {
    const rows = [...this.table.rows];
    if (rows.length === 0) return;
    const stations = this.table.values[this.table.chainageColumn];
    if (stations) rows.sort((a, b) => stations[a] - stations[b] || a - b);
    const at = rows.indexOf(this.chosen);
    this.choose(rows[at < 0 ? (by > 0 ? 0 : rows.length - 1) : (at + by + rows.length) % rows.length], true);
  }

  /** Binds the controls: those of the 3D view only if there is one. */
  bind() {
    $("keys").addEventListener("click", () => $("help").showModal());
    $("help-close").addEventListener("click", () => $("help").close());
    $("play").addEventListener("click", () => this.play());
    $("chainage").addEventListener("input", (event) => { this.stop(); this.driveTo(Number(event.target.value)); });
    $("plan").addEventListener("keydown", (event) => this.act(event));
    document.addEventListener("keydown", (event) => {
      // Where Escape closes the help or empties the field to find, it does only that.
      if (event.key !== "Escape" || $("help").open) return;
      if (event.target === this.table.filter.text && event.target.value) this.table.find("");
      else this.choose(-1);
    });
    if (this.scene) this.bindScene();
  }

  /** The card is on the view, or on the plan if there is no view. On a phone, both are too low for it alone. */
  bindCard() {
    const narrow = matchMedia(NARROW), place = () => (narrow.matches ? document.querySelector(".stage") : $(this.scene ? "view" : "plan").closest(".view, .plan")).append($("card"));
    place();
    narrow.addEventListener("change", () => { place(); this.plan.fit(); this.plan.draw(); });
  }

  bindScene() {
    const canvas = $("scene"), { camera } = this;
    let last = 0;
    follow(canvas, {
      touched: () => { this.stop(); },
      rest: () => this.render(),
      turn: (dx, dy) => { camera.turn(-dx * 0.006, dy * 0.006); this.render(true); },
      move: (dx, dy) => { camera.move((-dx / canvas.clientHeight) * 1.1, (dy / canvas.clientHeight) * 1.3); this.render(true); },
      zoom: (factor) => { this.stop(); camera.zoom(factor); this.render(true); },
      click: (x, y) => {
        const key = this.scene.pick(camera, x, y), row = key > 1 ? this.rowOf.get(key - 1) ?? -1 : -1;
        const twice = row >= 0 && row === this.chosen && performance.now() - last < 450;
        last = performance.now();
        this.choose(row, twice);
      },
    });
    canvas.addEventListener("keydown", (event) => this.key(event));
    $("whole").addEventListener("click", () => this.fly(this.poses.whole()));
    $("above").addEventListener("click", () => this.fly(this.poses.top()));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { camera } = this, far = event.shiftKey ? 20 : 3;
    const moves = {
      ArrowUp: () => this.driveTo((this.station ?? this.axis.from - far) + far), ArrowDown: () => this.driveTo((this.station ?? this.axis.from) - far),
      ArrowLeft: () => camera.turn(0.06, 0), ArrowRight: () => camera.turn(-0.06, 0),
      PageUp: () => camera.turn(0, 0.06), PageDown: () => camera.turn(0, -0.06),
      "+": () => camera.zoom(0.85), "=": () => camera.zoom(0.85), "-": () => camera.zoom(1.18),
      w: () => camera.move(0, 0.06), s: () => camera.move(0, -0.06), a: () => camera.move(-0.06, 0), d: () => camera.move(0.06, 0),
      Home: () => this.fly(this.poses.whole()), t: () => this.fly(this.poses.top()),
    };
    if (!moves[event.key]) { this.act(event); return; }
    this.stop();
    moves[event.key]();
    this.render(true);
    event.preventDefault();
  }

  /** The keys that need no 3D view. */
  act(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const acts = { n: () => this.step(1), p: () => this.step(-1), " ": () => this.play(), "?": () => $("help").showModal() };
    if (!acts[event.key]) return;
    acts[event.key]();
    event.preventDefault();
  }
}

const app = new App();
app.start().catch((error) => {
  console.error(error);
  $("scene-message").textContent = `The report cannot be shown: ${error.message}`;
});
