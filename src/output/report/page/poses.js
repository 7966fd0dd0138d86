// Poses of the camera: the whole drive, from above, the driver, and the side from which an object is seen best.

/** Points of an object that are looked at to find out whether it is seen. */
const LOOKS = 48;
/** Share of an object from which on it counts as seen (chosen). */
const SEEN_ENOUGH = 0.85;

/** Which cubes of one metre have points of which object, to find out what hides it. Ground hides nothing. */
class Sight {
  constructor(points) {
    this.cells = new Map();
    const { keys, places } = points;
    for (let at = 0; at < points.count; at++) {
      if (keys[at] === 0) continue;
      const cell = this.cell(places[3 * at], places[3 * at + 1], places[3 * at + 2]), owner = this.cells.get(cell);
      this.cells.set(cell, owner === undefined || owner === keys[at] ? keys[at] : Infinity);
    }
  }

  cell(x, y, z) {
    return ((Math.floor(x) + 0x20000) * 0x40000 + Math.floor(y) + 0x20000) * 0x1000 + Math.floor(z) + 0x800;
  }

  /**
   * Share of the places of a key that are seen from an eye. What is within 1.5 m of a place does not hide it.
   * `shows(key)`: whether the points of a key are shown.
   */
  share(eye, places, key, shows) {
    const free = (place) => {
      const way = place.map((value, axis) => value - eye[axis]), length = Math.hypot(...way);
      for (let gone = 0; gone < length - 1.5; gone += 0.5) {
        const [x, y, z] = way.map((value, axis) => eye[axis] + (value * gone) / length);
        const owner = this.cells.get(this.cell(x, y, z));
        if (owner !== undefined && owner !== key && shows(owner)) return false;
      }
      return true;
    };
    return places.filter(free).length / Math.max(1, places.length);
  }
}

class Poses {
  constructor(points, ground, axis, plan, camera, canvas) {
    Object.assign(this, { points, ground, axis, plan, camera, canvas, trial: new Camera(camera.radius) });
  }

  nearestStation(x, y) {
    let best = this.axis.from, least = Infinity;
    for (const stretch of this.axis.stretches) stretch.x.forEach((value, at) => {
      const apart = (value - x) ** 2 + (stretch.y[at] - y) ** 2;
      if (apart < least) { least = apart; best = stretch.s[at]; }
    });
    return best;
  }

  /** Some points of a key. Points are in the order of keys. */
  placesOf(key) {
    const { keys, places, count } = this.points;
    let from = 0, to = count;
    while (from < to) { const middle = (from + to) >> 1; if (keys[middle] < key) from = middle + 1; else to = middle; }
    let end = from;
    while (end < count && keys[end] === key) end++;
    const found = [];
    for (let at = from; at < end; at += Math.max(1, Math.floor((end - from) / LOOKS))) found.push([...places.subarray(3 * at, 3 * at + 3)]);
    return found;
  }

  /**
   * What the card and the controls leave of the canvas: the shares `wide` and `tall`, and its middle in clip
   * coordinates.
   */
  room(card) {
    const all = this.canvas.getBoundingClientRect(), taken = card.getBoundingClientRect();
    const above = ($("modes").getBoundingClientRect().bottom - all.top) / all.height;
    const isBelow = taken.width > 0.6 * all.width;
    const below = isBelow ? (all.bottom - taken.top) / all.height : 0, beside = isBelow || taken.width === 0 ? 0 : (all.right - taken.left) / all.width;
    return { wide: Math.max(0.3, 1 - beside), tall: Math.max(0.3, 0.95 - above - below), shift: [-beside, below - above] };
  }

  /**
   * A pose that shows the box of a key beside the card: from the axis if it is seen from there, else from another
   * side or from above. `shows(key)`: whether the points of a key are shown.
   */
  of(box, key, card, shows) {
    const centre = [0, 1, 2].map((axis) => (box[axis] + box[axis + 3]) / 2);
    const radius = Math.hypot(box[3] - box[0], box[4] - box[1], box[5] - box[2]) / 2;
    const { x, y } = this.axis.at(this.nearestStation(centre[0], centre[1]));
    const apart = Math.hypot(centre[0] - x, centre[1] - y);
    const facing = apart > 0.5 ? Math.atan2(centre[1] - y, centre[0] - x) : this.camera.yaw;
    const { wide, tall, shift } = this.room(card), { clientWidth, clientHeight } = this.canvas;
    const fitting = Math.tan(this.camera.opening / 2) * Math.min(tall, (wide * clientWidth) / Math.max(1, clientHeight));
    const distance = Math.max(5, (1.1 * radius) / fitting + 2);
    const places = this.placesOf(key);
    this.sight ??= new Sight(this.points);
    let best = null, most = -1;
    for (const pitch of [0.28, 0.5, 0.8, 1.2]) {
      for (const turn of [0.3, -0.3, 0, 0.8, -0.8]) {
        const pose = { target: centre, yaw: facing + turn, pitch, distance, shift };
        this.trial.take(pose);
        const eye = this.trial.eye();
        const share = eye[2] < this.ground.height(eye[0], eye[1]) + 0.5 ? 0 : this.sight.share(eye, places, key, shows);
        if (share >= SEEN_ENOUGH) return pose;
        if (share > most) { most = share; best = pose; }
      }
    }
    return best;
  }

  /** A pose from which nearly all points are seen, across the street, so that its length fills the width. */
  whole() {
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
    const { clientWidth, clientHeight } = this.canvas, aspect = clientWidth / Math.max(1, clientHeight);
    const wide = Math.max(u1 - u0, 20), deep = Math.max(v1 - v0, 10);
    const distance = Math.max((wide * 1.12 + deep * 0.6) / aspect, wide * 0.35 + deep * 0.8) + deep * 0.2 + 6;
    return { target: [...centre, this.ground.height(...centre) + 1.5], yaw: -plan.angle + Math.PI / 2 - 0.35, pitch: 0.72, distance };
  }

  /** The whole drive, or the beginning of a long one. */
  first() {
    const whole = this.whole();
    if (whole.distance < 500) return whole;
    const { x, y, heading } = this.axis.at(this.axis.from + 60);
    return { target: [x, y, this.ground.height(x, y)], yaw: heading + 0.25, pitch: 0.5, distance: 105 };
  }

  top() {
    const { camera, plan } = this;
    return { ...camera.pose(), shift: [0, 0], pitch: 1.5707, yaw: -plan.angle + Math.PI / 2, distance: Math.max(30, camera.distance) };
  }

  /** The pose of a driver at a chainage, who looks ahead. */
  drive(s) {
    const { x, y, heading } = this.axis.at(s);
    const ahead = 9;
    const place = [x + ahead * Math.cos(heading), y + ahead * Math.sin(heading)];
    return { target: [...place, this.ground.height(x, y) + 2.4], yaw: heading, pitch: 0.16, distance: 14 };
  }
}
