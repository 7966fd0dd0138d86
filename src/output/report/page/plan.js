// The plan of the street: axis, tiles, objects by class, scale bar, north, and where the eye is.

/** So many objects say better than the axis where the street is. */
const MANY = 12;
/**
 * Pixels that a narrow plan leaves to the scale bar, the arrow and the buttons: a strip below it, or columns beside it.
 * The one with the larger scale is taken. A wide plan has room for them. `around` the street, some is left, too.
 */
const MARGINS = { wide: { left: 0, right: 0, below: 0, around: [60, 44] }, strip: { left: 0, right: 0, below: 34, around: [30, 30] }, columns: { left: 70, right: 56, below: 0, around: [30, 16] } };

class Plan {
  constructor(canvas, axis, outlines, tiles, on) {
    Object.assign(this, { canvas, axis, outlines, tiles, on, chosen: -1, shown: () => true, eye: null });
    this.context = canvas.getContext("2d");
    this.boxes = outlines.map((outline) => {
      const box = [Infinity, Infinity, -Infinity, -Infinity];
      for (let at = 0; at < outline.length; at += 2) {
        box[0] = Math.min(box[0], outline[at]); box[2] = Math.max(box[2], outline[at]);
        box[1] = Math.min(box[1], outline[at + 1]); box[3] = Math.max(box[3], outline[at + 1]);
      }
      return box;
    });
    this.turnAlongStreet();
    this.fit();
    follow(canvas, {
      touched: () => {}, rest: () => {},
      turn: (dx, dy) => this.shift(dx, dy), move: (dx, dy) => this.shift(dx, dy),
      zoom: (factor, x, y) => this.zoom(1 / factor, x, y),
      click: (x, y) => this.click(x, y),
    });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] }[event.key];
      if (step) this.shift(...step);
      else if (event.key === "+" || event.key === "=") this.zoom(1.4);
      else if (event.key === "-") this.zoom(1 / 1.4);
      else if (event.key === "0" || event.key === "Home") { this.fit(); this.draw(); }
      else return;
      event.preventDefault();
    });
  }

  /** The long side of the street becomes horizontal. */
  turnAlongStreet() {
    let n = 0, mx = 0, my = 0;
    // Of the objects, where there are enough: the axis of a single sweep says little.
    const objects = this.boxes.filter((box) => box[0] <= box[2]).map((box) => [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2]);
    const all = objects.length >= MANY ? objects : this.axis.stretches.flatMap((stretch) => stretch.x.map((x, at) => [x, stretch.y[at]]));
    for (const [x, y] of all) { n++; mx += x; my += y; }
    mx /= n || 1; my /= n || 1;
    let xx = 0, xy = 0, yy = 0;
    for (const [x, y] of all) { xx += (x - mx) ** 2; xy += (x - mx) * (y - my); yy += (y - my) ** 2; }
    this.angle = -0.5 * Math.atan2(2 * xy, xx - yy);
    this.sin = Math.sin(this.angle);
    this.cos = Math.cos(this.angle);
  }

  turned(x, y) { return [this.cos * x - this.sin * y, this.sin * x + this.cos * y]; }

  /** The place on the canvas of a place in metres. */
  place(x, y) {
    const [u, v] = this.turned(x, y);
    const [x0, y0] = this.middle();
    return [x0 + (u - this.centre[0]) * this.scale, y0 - (v - this.centre[1]) * this.scale];
  }

  fit() {
    const box = () => ({ low: [Infinity, Infinity], high: [-Infinity, -Infinity] });
    const seen = box(), objects = box();
    const see = ({ low, high }, x, y) => this.turned(x, y).forEach((value, k) => { low[k] = Math.min(low[k], value); high[k] = Math.max(high[k], value); });
    for (const stretch of this.axis.stretches) stretch.x.forEach((x, at) => see(seen, x, stretch.y[at]));
    for (const outline of this.outlines) for (let at = 0; at < outline.length; at += 2) [seen, objects].forEach((all) => see(all, outline[at], outline[at + 1]));
    if (seen.low[0] > seen.high[0]) { seen.low.fill(-10); seen.high.fill(10); }
    // A narrow page has no room for an axis across the objects, as that of a single sweep may be.
    const narrow = matchMedia(NARROW).matches;
    if (narrow && this.boxes.length >= MANY) [seen.low[1], seen.high[1]] = [objects.low[1], objects.high[1]];
    this.centre = [0, 1].map((k) => (seen.low[k] + seen.high[k]) / 2);
    const [along, across] = [0, 1].map((k) => Math.max(5, seen.high[k] - seen.low[k]));
    // On a narrow page, the plan gets the height with which it fills the width.
    const [aside, above] = MARGINS.strip.around;
    this.size();
    this.canvas.closest(".stage").style.setProperty("--plan", `${Math.ceil(((this.width - aside) * across) / along + above + MARGINS.strip.below)}px`);
    this.size();
    const scale = ({ left, right, below, around }) => Math.min((this.width - left - right - around[0]) / along, (this.height - below - around[1]) / across);
    this.margins = narrow ? (scale(MARGINS.columns) > scale(MARGINS.strip) ? MARGINS.columns : MARGINS.strip) : MARGINS.wide;
    this.canvas.parentElement.dataset.margins = this.margins === MARGINS.columns ? "columns" : "";
    this.scale = scale(this.margins);
    Object.assign(this, { along, across });
    this.least = this.scale / 2;
  }

  size() {
    this.width = Math.max(1, this.canvas.clientWidth);
    this.height = Math.max(1, this.canvas.clientHeight);
  }

  /** The middle of what the margins leave of the canvas. */
  middle() {
    const { left, right, below } = this.margins;
    return [(left + this.width - right) / 2, (this.height - below) / 2];
  }

  shift(dx, dy) {
    this.centre = [this.centre[0] - dx / this.scale, this.centre[1] + dy / this.scale];
    this.draw();
  }

  zoom(factor, x = this.middle()[0], y = this.middle()[1]) {
    const scale = Math.min(200, Math.max(this.least, this.scale * factor));
    const [x0, y0] = this.middle(), dx = x - x0, dy = y0 - y;
    this.centre = [this.centre[0] + dx / this.scale - dx / scale, this.centre[1] + dy / this.scale - dy / scale];
    this.scale = scale;
    this.draw();
  }

  /** Moves the plan if a place is not on it. */
  show(x, y) {
    const [px, py] = this.place(x, y), { left, right, below } = this.margins;
    const edge = Math.min(20, (this.height - below) / 10);
    if (px < left + edge || py < edge || px > this.width - right - edge || py > this.height - below - edge) this.centre = this.turned(x, y);
  }

  click(x, y) {
    let best = -1, smallest = Infinity;
    this.outlines.forEach((outline, row) => {
      if (!this.shown(row) || outline.length === 0) return;
      const ring = [];
      for (let at = 0; at < outline.length; at += 2) ring.push(this.place(outline[at], outline[at + 1]));
      let within = false, area = 0, near = Infinity;
      ring.forEach(([ax, ay], at) => {
        const [bx, by] = ring[(at + 1) % ring.length];
        if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) within = !within;
        area += ax * by - bx * ay;
        near = Math.min(near, Math.hypot(ax - x, ay - y));
      });
      area = Math.abs(area);
      if ((within || near < 6) && area < smallest) { smallest = area; best = row; }
    });
    this.on.choose(best);
  }

  draw() {
    const { context: pen, canvas } = this;
    const dots = Math.min(devicePixelRatio || 1, 2);
    this.size();
    canvas.width = Math.round(this.width * dots);
    canvas.height = Math.round(this.height * dots);
    pen.setTransform(dots, 0, 0, dots, 0, 0);
    const style = getComputedStyle(document.documentElement);
    const [ink, soft, line, card, accent] = ["--ink", "--soft", "--line", "--card", "--accent"].map((name) => style.getPropertyValue(name).trim());
    pen.lineJoin = pen.lineCap = "round";
    pen.font = "11px system-ui, sans-serif";
    this.drawTiles(pen, line, soft);
    this.outlines.forEach((outline, row) => {
      const box = this.boxes[row];
      if (!this.shown(row) || outline.length === 0) return;
      const [x, y] = this.place((box[0] + box[2]) / 2, (box[1] + box[3]) / 2);
      const reach = ((box[2] - box[0] + box[3] - box[1]) * this.scale) / 2 + 4;
      if (x < -reach || y < -reach || x > this.width + reach || y > this.height + reach) return;
      const colour = row === this.chosen ? accent : this.on.colour(row);
      pen.beginPath();
      for (let at = 0; at < outline.length; at += 2) pen.lineTo(...this.place(outline[at], outline[at + 1]));
      pen.closePath();
      pen.fillStyle = colour;
      // Darker on a light page: thin lines in yellow or light blue would be lost.
      pen.strokeStyle = row === this.chosen ? colour : mixed(colour, ink, 0.25);
      pen.globalAlpha = row === this.chosen ? 0.75 : 0.4;
      pen.fill();
      pen.globalAlpha = 1;
      pen.lineWidth = row === this.chosen ? 2.5 : 1.2;
      pen.stroke();
      if (reach < 7) { pen.beginPath(); pen.arc(x, y, row === this.chosen ? 4 : 2, 0, 7); pen.fill(); }
    });
    this.drawAxis(pen, ink, soft, card);
    this.drawEye(pen, accent, card);
    this.drawScale(pen, ink, card);
  }

  /** Tiles as bands along the axis, in two tones, because they follow one another along it. */
  drawTiles(pen, line, soft) {
    const stretchOf = (from, to) => {
      const step = Math.max(1, (to - from) / 60), places = [];
      for (let s = from; s < to; s += step) places.push(s);
      return [...places, to].map((s) => this.axis.at(s));
    };
    pen.lineCap = "butt";
    this.tiles.forEach((tile, number) => {
      pen.beginPath();
      for (const { x, y } of stretchOf(tile.from_m, Math.max(tile.to_m, tile.from_m + 0.5))) pen.lineTo(...this.place(x, y));
      pen.strokeStyle = number % 2 ? soft : line;
      pen.globalAlpha = number % 2 ? 0.22 : 0.8;
      pen.lineWidth = 14;
      pen.stroke();
    });
    pen.globalAlpha = 1;
    pen.lineCap = "round";
  }

  drawAxis(pen, ink, soft, card) {
    pen.strokeStyle = ink;
    pen.lineWidth = 1.4;
    for (const { x, y } of this.axis.stretches) {
      pen.beginPath();
      x.forEach((value, at) => pen.lineTo(...this.place(value, y[at])));
      pen.stroke();
    }
    const step = niceStep(110 / this.scale);
    for (let s = Math.ceil(this.axis.from / step) * step; s <= this.axis.to; s += step) {
      const { x, y, heading } = this.axis.at(s), [px, py] = this.place(x, y);
      pen.beginPath();
      pen.arc(px, py, 2.4, 0, 7);
      pen.fillStyle = ink;
      pen.fill();
      // Beside the axis, on its upper side, and within the plan.
      const along = heading + this.angle, text = `${shown(s)} m`, half = pen.measureText(text).width / 2;
      const up = Math.cos(along) < 0 ? -1 : 1, aside = 13 + Math.abs(Math.sin(along)) * (half - 4);
      const tx = Math.min(this.width - this.margins.right - half - 4, Math.max(this.margins.left + half + 4, px - up * Math.sin(along) * aside));
      const ty = Math.min(this.height - this.margins.below - 5, Math.max(12, py - up * Math.cos(along) * aside + 4));
      pen.textAlign = "center";
      pen.lineWidth = 3.5;
      pen.strokeStyle = card;
      pen.strokeText(text, tx, ty);
      pen.fillStyle = soft;
      pen.fillText(text, tx, ty);
    }
  }

  drawEye(pen, accent, card) {
    if (!this.eye) return;
    const [x, y] = this.place(this.eye.x, this.eye.y), angle = -(this.eye.yaw + this.angle);
    pen.save();
    pen.translate(x, y);
    pen.rotate(angle);
    pen.beginPath();
    pen.moveTo(0, 0);
    pen.arc(0, 0, 34, -0.45, 0.45);
    pen.closePath();
    pen.fillStyle = accent;
    pen.globalAlpha = 0.28;
    pen.fill();
    pen.globalAlpha = 1;
    pen.beginPath();
    pen.arc(0, 0, 5, 0, 7);
    pen.fill();
    pen.strokeStyle = card;
    pen.lineWidth = 1.5;
    pen.stroke();
    pen.restore();
  }

  drawScale(pen, ink, card) {
    const { left, right, below } = this.margins, isColumn = left > 0;
    pen.fillStyle = card;
    pen.fillRect(0, 0, left, this.height);
    pen.fillRect(this.width - right, 0, right, this.height);
    pen.fillRect(0, this.height - below, this.width, below);
    // At most half as long as the street. In a column, half as long, with its text above it.
    const metres = this.bar = Math.min(niceStep((isColumn ? 20 : 60) / this.scale), niceStep(this.along / 5)), length = metres * this.scale;
    const x = isColumn ? 10 : 14, y = this.height - 14, [tx, ty] = isColumn ? [x, y - 9] : [x + length + 6, y];
    pen.strokeStyle = ink;
    pen.fillStyle = ink;
    pen.lineWidth = 1.6;
    pen.beginPath();
    pen.moveTo(x, y - 4); pen.lineTo(x, y); pen.lineTo(x + length, y); pen.lineTo(x + length, y - 4);
    pen.stroke();
    pen.textAlign = "left";
    pen.lineWidth = 3.5;
    pen.strokeStyle = card;
    pen.strokeText(`${shown(metres)} m`, tx, ty);
    pen.fillText(`${shown(metres)} m`, tx, ty);
    this.drawNorth(pen, below > 0);
  }

  /** The arrow to the north: in a corner, or in the strip beside the buttons. */
  drawNorth(pen, inStrip) {
    const buttons = this.canvas.parentElement.querySelector(".buttons");
    const [x, y, size] = inStrip ? [this.width - buttons.offsetWidth - 30, this.height - this.margins.below / 2, 0.7] : [30, 34, 1];
    pen.save();
    pen.translate(x, y);
    pen.rotate(-this.angle);
    pen.scale(size, size);
    pen.beginPath();
    pen.moveTo(0, -13); pen.lineTo(5.5, 8); pen.lineTo(0, 4.5); pen.lineTo(-5.5, 8);
    pen.closePath();
    pen.fill();
    pen.restore();
    // The letter stays upright: beside the tip of the arrow, or in a low strip beside the arrow.
    pen.textAlign = "center";
    if (inStrip) pen.fillText("N", x - 16, y + 4);
    else pen.fillText("N", x - 20 * Math.sin(this.angle), y + 4 - 20 * Math.cos(this.angle));
  }
}

/** The smallest of 1, 2, 5, 10, ... that is not below a value. */
function niceStep(value, steps = [1, 2, 5, 10]) {
  const decade = 10 ** Math.floor(Math.log10(value));
  return steps.map((step) => step * decade).find((step) => step >= value * 0.999) ?? value;
}
