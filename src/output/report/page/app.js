// Joins the parts of the page: what is chosen, how points are coloured, where the eye is.

const MODES = [["object", "Object"], ["class", "Class"], ["height", "Height"], ["intensity", "Intensity"]];

/** Objects up to which the plan is drawn with every picture. */
const FEW_OUTLINES = 1500;

class App {
  constructor() {
    this.page = json("data-page");
    this.run = json("data-run");
    this.classes = this.page.classes;
    this.chosen = -1;
    this.hidden = new Set();
    this.theme = {};
    this.fillHead();
    this.bindTabs();
    this.bindTheme();
  }

  fillHead() {
    const { page, run } = this, { result } = run;
    $("title").textContent = page.title;
    $("subtitle").textContent = [page.files, run.crs.description && `coordinate system ${run.crs.description}`, run.program].filter(Boolean).join(" · ");
    const figures = [["Length", run.axis.length_m < 1000 ? `${shown(run.axis.length_m, 0)} m` : `${shown(run.axis.length_m / 1000, 2)} km`, ""], ["Points", shown(result.points), ""], ["Objects", shown(result.objects), ""], ["Time", seconds(result.seconds), ""], ["Memory", result.peak_resident_bytes ? mebibytes(result.peak_resident_bytes) : "", "extra"]];
    $("figures").replaceChildren(...figures.filter(([, value]) => value).map(([name, value, kind]) => el("div", { class: kind || null }, el("dt", {}, name), el("dd", {}, value))));
  }

  bindTabs() {
    const tabs = [...$("tabs").children];
    const show = (tab) => {
      for (const other of tabs) {
        other.setAttribute("aria-selected", String(other === tab));
        other.tabIndex = other === tab ? 0 : -1;
        $(other.getAttribute("aria-controls")).hidden = other !== tab;
      }
    };
    tabs.forEach((tab, at) => {
      tab.addEventListener("click", () => show(tab));
      tab.addEventListener("keydown", (event) => {
        const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (!by) return;
        const next = tabs[(at + by + tabs.length) % tabs.length];
        show(next);
        next.focus();
      });
    });
    show(tabs[0]);
  }

  bindTheme() {
    const system = matchMedia("(prefers-color-scheme: dark)");
    const apply = (dark) => {
      document.documentElement.dataset.theme = dark ? "dark" : "light";
      const style = getComputedStyle(document.documentElement);
      const part = (name) => rgb(style.getPropertyValue(name).trim()).map((value) => value / 255);
      this.theme = { name: dark ? "dark" : "light", sky: part("--sky"), haze: part("--haze"), accent: part("--accent") };
      if (this.scene) this.paint();
      this.plan?.draw();
    };
    apply(system.matches);
    system.addEventListener("change", (event) => apply(event.matches));
    $("theme").addEventListener("click", () => apply(this.theme.name !== "dark"));
  }

  async start() {
    fillRun($("run-panel"), this.run, this.page);
    const data = JSON.parse(new TextDecoder().decode(await inflated("data-table")));
    this.outlines = data.outlines;
    this.axis = new Axis(this.page.axis);
    this.table = new ObjectTable(data, this.classes, { choose: (row) => this.choose(row, true), filtered: (rows) => this.filtered(rows) });
    this.rowOf = new Map(this.table.values.length ? this.table.values[0].map((id, row) => [id, row]) : []);
    fillStatistics($("classes-panel"), this.table);
    this.plan = new Plan($("plan"), this.axis, this.outlines, this.run.tiles, { choose: (row) => this.choose(row, row >= 0), colour: (row) => this.colourOf(row) });
    this.plan.shown = (row) => this.isShown(row);
    this.classified = this.table.classColumn >= 0 && this.table.values[this.table.classColumn].some((code) => code !== 0);
    this.stations();
    try {
      await this.startScene();
    } catch (error) {
      $("scene-message").textContent = `The 3D view needs WebGL 2 (${error.message}). The plan, the table and the statistics work without it.`;
      $("scene-message").hidden = false;
    }
    this.plan.draw();
    addEventListener("resize", () => { this.plan.draw(); this.render(); });
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
    this.fillModes();
    this.bindScene();
    $("scene-message").hidden = points.count > 0;
    if (points.count === 0) $("scene-message").textContent = "The drive has no points to show.";
    this.paint();
    this.camera.take(this.firstPose());
    this.render();
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

  isShown(row, code = this.classOf(row)) { return !this.hidden.has(code) && (!this.passing || this.passing.has(row)); }

  /** Called when the filters of the table change: objects that do not pass are hidden. */
  filtered(rows) {
    const before = this.passing;
    this.passing = rows.length === this.table?.count || !this.table ? null : new Set(rows);
    if (!before && !this.passing) return;
    if (this.scene) this.paint();
    this.plan?.draw();
  }

  fillModes() {
    const { classified } = this;
    this.mode = classified ? "class" : "object";
    $("modes").append(...MODES.filter(([mode]) => classified || mode !== "class").map(([mode, text]) => {
      const input = el("input", { type: "radio", name: "mode", value: mode, id: `mode-${mode}`, onchange: () => { this.mode = mode; this.paint(); } });
      input.checked = mode === this.mode;
      return el("label", {}, input, el("span", {}, text));
    }));
  }

  /** Colours every point for the mode: the sample now, and streamed points while pictures are drawn. */
  paint() {
    const { mode, theme, ground, hidden } = this;
    this.colour = colouring({ mode, theme, ground, hidden, rowOf: (id) => this.rowOf.get(id), classOf: (row) => this.classOf(row), isShown: (row, code) => this.isShown(row, code) });
    this.painted = (this.painted ?? 0) + 1;
    this.scene.paint(this.colour, this.painted);
    this.fillLegend();
    this.render();
  }

  fillLegend() {
    const { mode } = this;
    const switchFor = (what, colour, text, count) => el("button", { type: "button", "aria-pressed": String(!this.hidden.has(what)), title: `Show or hide: ${text}`, onclick: () => { if (!this.hidden.delete(what)) this.hidden.add(what); this.paint(); this.plan.draw(); } }, dot(colour), text, count === undefined ? null : el("small", {}, shown(count)));
    const parts = [];
    if (mode === "height" || mode === "intensity") {
      const bar = el("i");
      bar.style.background = `linear-gradient(90deg, ${(mode === "height" ? HEIGHT_RAMP : INTENSITY_RAMP[this.theme.name]).join(", ")})`;
      parts.push(el("span", { class: "ramp" }, mode === "height" ? "ground" : "low", bar, mode === "height" ? `${HIGHEST_M} m over it` : "high"));
    }
    const codes = new Map();
    for (let row = 0; row < this.table.count; row++) codes.set(this.classOf(row), (codes.get(this.classOf(row)) ?? 0) + 1);
    if (mode === "object") {
      const many = dot("");
      many.style.background = `conic-gradient(${[0, 1, 2, 3, 4, 5].map((number) => hueColour(3 * number)).join(", ")})`;
      parts.push(el("span", { class: "ramp" }, many, "a colour for each object"));
    } else if (mode === "class") {
      for (const code of [...codes.keys()].sort((a, b) => a - b)) parts.push(switchFor(code, classColour(code), className(this.classes, code), codes.get(code)));
    }
    parts.push(switchFor("ground", GROUND_COLOUR[this.theme.name], "ground"), switchFor("loose", LOOSE_COLOUR[this.theme.name], "no object"));
    $("legend").replaceChildren(...parts);
  }

  /** Draws at the next frame. */
  render(moving = false) {
    if (!this.scene) return;
    this.wanted = { moving: moving || (this.wanted?.moving ?? false) };
    if (this.frame) return;
    this.frame = requestAnimationFrame(() => {
      this.frame = null;
      const { moving: fast } = this.wanted;
      this.wanted = null;
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
    const box = this.boxes?.[this.chosen], tag = $("tag"), canvas = $("scene");
    const place = box && this.camera.project([(box[0] + box[3]) / 2, (box[1] + box[4]) / 2, box[5] + 0.3], canvas.clientWidth, canvas.clientHeight);
    tag.hidden = !place || place[0] < 0 || place[1] < 0 || place[0] > canvas.clientWidth || place[1] > canvas.clientHeight;
    if (tag.hidden) return;
    tag.textContent = this.nameOf(this.chosen);
    tag.style.transform = `translate(${place[0]}px, ${place[1]}px) translate(-50%, -130%)`;
  }

  nameOf(row) {
    const code = this.classOf(row);
    return `${code ? className(this.classes, code) : "object"} ${this.table.id(row)}`;
  }

  choose(row, fly = false) {
    this.chosen = row;
    const card = $("card");
    card.hidden = row < 0;
    if (row >= 0) {
      const { table } = this;
      const title = el("h2", {}, this.nameOf(row));
      const close = el("button", { type: "button", class: "icon", "aria-label": "Close", onclick: () => this.choose(-1) }, "×");
      const values = table.order.flatMap((at) => {
        const column = table.columns[at], text = table.text(at, row);
        if (at === 0 || at === table.classColumn || text === "") return [];
        return [el("dt", { title: column.definition }, labelOf(column)), el("dd", {}, text)];
      });
      card.replaceChildren(el("header", {}, dot(this.colourOf(row)), title, close), el("dl", {}, ...values));
      const box = this.boxes?.[row];
      if (fly && box && this.camera) this.fly(this.poseOf(box));
      const outline = this.outlines[row];
      if (outline?.length) this.plan.show(outline[0], outline[1]);
    }
    this.table.choose(row);
    this.plan.chosen = row;
    this.plan.draw();
    this.render();
  }

  /** A pose that shows a box from the side of the axis. */
  poseOf(box) {
    const centre = [0, 1, 2].map((axis) => (box[axis] + box[axis + 3]) / 2);
    const size = Math.hypot(box[3] - box[0], box[4] - box[1], box[5] - box[2]);
    const { x, y } = this.axis.at(this.nearestStation(centre[0], centre[1]));
    const apart = Math.hypot(centre[0] - x, centre[1] - y);
    const yaw = apart > 0.5 ? Math.atan2(centre[1] - y, centre[0] - x) : this.camera.yaw;
    return { target: centre, yaw: yaw + 0.35, pitch: 0.28, distance: Math.max(5, size * 1.35 + 2) };
  }

  nearestStation(x, y) {
    let best = this.axis.from, least = Infinity;
    for (const stretch of this.axis.stretches) stretch.x.forEach((value, at) => {
      const apart = (value - x) ** 2 + (stretch.y[at] - y) ** 2;
      if (apart < least) { least = apart; best = stretch.s[at]; }
    });
    return best;
  }

  /** A pose from which nearly all points are seen, across the street, so that its length fills the width. */
  wholePose() {
    const { points, camera, plan } = this, along = [], across = [];
    for (let at = 0; at < points.count; at += 1 + (points.count >> 13)) {
      const [u, v] = plan.turned(points.places[3 * at], points.places[3 * at + 1]);
      along.push(u);
      across.push(v);
    }
    if (along.length === 0) return camera.pose();
    const ends = (values) => { values.sort((a, b) => a - b); return [0.02, 0.98].map((share) => values[Math.floor(share * (values.length - 1))]); };
    const [[u0, u1], [v0, v1]] = [ends(along), ends(across)], u = (u0 + u1) / 2, v = (v0 + v1) / 2;
    const centre = [plan.cos * u + plan.sin * v, -plan.sin * u + plan.cos * v];
    const { clientWidth, clientHeight } = $("scene"), aspect = clientWidth / Math.max(1, clientHeight);
    const wide = Math.max(u1 - u0, 20), deep = Math.max(v1 - v0, 10);
    const distance = Math.max((wide * 1.12 + deep * 0.6) / aspect, wide * 0.35 + deep * 0.8) + deep * 0.2 + 6;
    return { target: [...centre, this.ground.height(...centre) + 1.5], yaw: -plan.angle + Math.PI / 2 - 0.35, pitch: 0.72, distance };
  }

  /** The whole drive, or the beginning of a long one. */
  firstPose() {
    const whole = this.wholePose();
    if (whole.distance < 500) return whole;
    const { x, y, heading } = this.axis.at(this.axis.from + 60);
    return { target: [x, y, this.ground.height(x, y)], yaw: heading + 0.25, pitch: 0.5, distance: 105 };
  }

  /** The pose of a driver at a chainage, who looks ahead. */
  drivePose(s) {
    const { x, y, heading } = this.axis.at(s);
    const ahead = 9;
    const place = [x + ahead * Math.cos(heading), y + ahead * Math.sin(heading)];
    return { target: [...place, this.ground.height(x, y) + 2.4], yaw: heading, pitch: 0.16, distance: 14 };
  }

  fly(pose) {
    this.stop();
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
    const text = `${shown(Math.round(s))} of ${shown(Math.round(this.axis.to))} m`;
    $("station").textContent = text;
    $("chainage").setAttribute("aria-valuetext", text);
  }

  /** Goes to a chainage; `glide` moves there from where the eye is. */
  driveTo(s, glide = false) {
    const at = Math.min(this.axis.to, Math.max(this.axis.from, s));
    $("chainage").value = at;
    this.tellStation(at);
    this.station = at;
    if (!this.camera) return;
    if (glide) { this.fly(this.drivePose(at)); return; }
    this.camera.take(this.drivePose(at));
    this.render(true);
  }

  play() {
    const drive = !this.driving;
    this.stop();
    if (!drive || !this.camera) return;
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
    $("whole").addEventListener("click", () => this.fly(this.wholePose()));
    $("above").addEventListener("click", () => this.fly(this.topPose()));
    $("keys").addEventListener("click", () => $("help").showModal());
    $("play").addEventListener("click", () => this.play());
    $("chainage").addEventListener("input", (event) => { this.stop(); this.driveTo(Number(event.target.value)); });
  }

  topPose() { return { ...this.camera.pose(), pitch: 1.5707, yaw: -this.plan.angle + Math.PI / 2, distance: Math.max(30, this.camera.distance) }; }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { camera } = this, far = event.shiftKey ? 20 : 3;
    const moves = {
      ArrowUp: () => this.driveTo((this.station ?? this.axis.from - far) + far), ArrowDown: () => this.driveTo((this.station ?? this.axis.from) - far),
      ArrowLeft: () => camera.turn(0.06, 0), ArrowRight: () => camera.turn(-0.06, 0),
      PageUp: () => camera.turn(0, 0.06), PageDown: () => camera.turn(0, -0.06),
      "+": () => camera.zoom(0.85), "=": () => camera.zoom(0.85), "-": () => camera.zoom(1.18),
      w: () => camera.move(0, 0.06), s: () => camera.move(0, -0.06), a: () => camera.move(-0.06, 0), d: () => camera.move(0.06, 0),
    };
    const acts = { n: () => this.step(1), p: () => this.step(-1), Home: () => this.fly(this.wholePose()), t: () => this.fly(this.topPose()), " ": () => this.play(), Escape: () => this.choose(-1), "?": () => $("help").showModal() };
    if (moves[event.key]) { this.stop(); moves[event.key](); this.render(true); }
    else if (acts[event.key]) acts[event.key]();
    else return;
    event.preventDefault();
  }
}

const app = new App();
app.start().catch((error) => {
  console.error(error);
  $("scene-message").textContent = `The report cannot be shown: ${error.message}`;
});
