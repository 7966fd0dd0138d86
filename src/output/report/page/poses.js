// Poses of the camera: the whole drive, from above, the driver, and the side from which an object is seen best.

/** Points of an object that are looked at to find out whether it is seen. */
const LOOKS = 48;
/** Share of an object from which on it counts as seen (chosen). */
const SEEN_ENOUGH = 0.85;
/** Objects, and points of each, that are looked at to choose the view of a street: a tenth of a second. */
const MOST_OBJECTS = 64, FEW_LOOKS = 4;
/** Pitches of a view of a street, the lowest first. The last one is nearly from above. */
const PITCHES = [0.72, 0.95, 1.1, 1.25, 1.4];
/**
 * Share of what the best view sees from which on a lower one is taken (chosen). It is no share of everything, because
 * what is below a tree is hidden from every side.
 */
const NEARLY_BEST = 0.8;
/** Distance of the eye from which on a drive is too long to be shown whole, and objects are looked at that near (m). */
const LONG_VIEW_M = 500, NEAR_M = 90;

/** Which cubes of one metre have points of which object, to find out what hides it. Ground hides nothing. */
class Sight {
  constructor(points) {
    this.cells = new Map();
    this.highest = -Infinity;
    const { keys, places } = points;
    for (let at = 0; at < points.count; at++) {
      if (keys[at] === 0) continue;
      if (places[3 * at + 2] > this.highest) this.highest = places[3 * at + 2];
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
    // From the place to the eye, because what hides it is mostly near, and nothing is above the highest point.
    const free = (place) => {
      const way = eye.map((value, axis) => value - place[axis]), length = Math.hypot(...way);
      const [x, y, z] = place, [dx, dy, dz] = way.map((value) => value / length);
      for (let gone = 1.5; gone < length && z + dz * gone <= this.highest; gone += 0.5) {
        const owner = this.cells.get(this.cell(x + dx * gone, y + dy * gone, z + dz * gone));
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
  placesOf(key, looks = LOOKS) {
    const { keys, places, count } = this.points;
    let from = 0, to = count;
    while (from < to) { const middle = (from + to) >> 1; if (keys[middle] < key) from = middle + 1; else to = middle; }
    let end = from;
    while (end < count && keys[end] === key) end++;
    const found = [];
    for (let at = from; at < end; at += Math.max(1, Math.floor((end - from) / looks))) found.push([...places.subarray(3 * at, 3 * at + 3)]);
    return found;
  }

  /** Some objects, each with some of its places; only those near a place, if one is given. */
  someObjects(near) {
    const { keys, places, count } = this.points, found = [];
    for (let at = 0, before = 1; at < count; at++) {
      if (keys[at] <= before) continue;
      before = keys[at];
      if (!near || Math.hypot(places[3 * at] - near[0], places[3 * at + 1] - near[1]) < NEAR_M) found.push(before);
    }
    const every = Math.max(1, Math.ceil(found.length / MOST_OBJECTS));
    return found.filter((_, number) => number % every === 0).map((key) => ({ key, places: this.placesOf(key, FEW_LOOKS) }));
  }

  /**
   * The first pose that sees nearly as much of the objects as the best one. Between facades, low poses see the backs
   * of the buildings and nothing of the street.
   */
  clearest(poses, objects) {
    this.sight ??= new Sight(this.points);
    const shares = poses.map((pose) => {
      this.trial.take(pose);
      const eye = this.trial.eye();
      return objects.reduce((sum, { key, places }) => sum + this.sight.share(eye, places, key, () => true), 0);
    });
    return poses[shares.findIndex((share) => share >= NEARLY_BEST * Math.max(...shares))];
  }

  /**
   * What the card and the controls leave of the canvas: the shares `wide` and `tall`, and its middle in clip
   * coordinates.
   */
  room(card) {
    const all = this.canvas.getBoundingClientRect(), taken = card.getBoundingClientRect();
    const above = ($("modes").getBoundingClientRect().bottom - all.top) / all.height;
    const isBelow = taken.width > 0.6 * all.width;
    const below = isBelow ? Math.max(0, all.bottom - taken.top) / all.height : 0, beside = isBelow || taken.width === 0 ? 0 : (all.right - taken.left) / all.width;
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

  /** Corners of what the controls and the legend leave of the canvas, in clip coordinates: left, below, right, above. */
  freeCorners() {
    const all = this.canvas.getBoundingClientRect();
    const at = (y) => 1 - (2 * (y - all.top)) / Math.max(1, all.height);
    return [-0.95, Math.min(-0.3, at($("legend").getBoundingClientRect().top) + 0.03), 0.95, Math.max(0.3, at($("modes").getBoundingClientRect().bottom) - 0.03)];
  }

  /** The pose with the target and the distance at which nearly all of the places fill the free part of the canvas. */
  filling(pose, places) {
    const { trial, canvas: { clientWidth, clientHeight } } = this, aspect = clientWidth / Math.max(1, clientHeight);
    const [left, below, right, above] = this.freeCorners(), middle = [(left + right) / 2, (below + above) / 2];
    let { target, distance } = pose;
    for (let turn = 0; turn < 8; turn++) {
      trial.take({ ...pose, target, distance });
      const seen = places.map((place) => trial.project(place, 2 * aspect, 2)).filter(Boolean);
      // Places behind the eye: from further away.
      if (seen.length < 0.98 * places.length) { distance *= 1.5; continue; }
      const ends = [0, 1].map((side) => {
        const values = seen.map((place) => (side ? 1 - place[1] : place[0] / aspect - 1)).sort((a, b) => a - b);
        return [0.006, 0.994].map((share) => values[Math.round(share * (values.length - 1))]);
      });
      const [dx, dy] = ends.map(([low, high], side) => (low + high) / 2 - middle[side]);
      const half = Math.tan(trial.opening / 2) * distance, [x, y] = trial.ahead();
      const aside = dx * half * aspect, ahead = (dy * half) / Math.sin(pose.pitch);
      target = [target[0] + y * aside + x * ahead, target[1] - x * aside + y * ahead, target[2]];
      const full = Math.max((ends[0][1] - ends[0][0]) / (right - left), (ends[1][1] - ends[1][0]) / (above - below));
      distance = Math.max(16, distance * Math.min(2, Math.max(0.5, full)));
    }
    return { ...pose, target, distance };
  }

  /** A pose that shows nearly all points, across the street, so that its length fills the width. */
  whole() {
    const { points, camera, plan } = this, all = [];
    for (let at = 0; at < points.count; at += 1 + (points.count >> 12)) all.push(at);
    if (all.length === 0) return camera.pose();
    // Points of no object may be far away, behind windows; without objects there is nothing else.
    const inside = all.filter((at) => points.keys[at] !== 1), chosen = inside.length > all.length / 2 ? inside : all;
    const places = chosen.map((at) => [...points.places.subarray(3 * at, 3 * at + 3)]);
    const middle = [0, 1].map((axis) => { const values = places.map((place) => place[axis]).sort((a, b) => a - b); return values[values.length >> 1]; });
    const target = [...middle, this.ground.height(...middle)], distance = 2 * camera.radius;
    if (!this.angles) {
      const sides = [-0.35, 0.35, Math.PI - 0.35, Math.PI + 0.35].map((turn) => -plan.angle + Math.PI / 2 + turn);
      const poses = PITCHES.flatMap((pitch) => sides.map((yaw) => this.filling({ target, yaw, pitch, distance }, places)));
      const { yaw, pitch } = this.clearest(poses, this.someObjects());
      this.angles = { yaw, pitch };
    }
    return this.filling({ target, ...this.angles, distance }, places);
  }

  /** The whole drive, or the beginning of a long one. */
  first() {
    const whole = this.whole();
    if (whole.distance < LONG_VIEW_M) return whole;
    const { x, y, heading } = this.axis.at(this.axis.from + 60), target = [x, y, this.ground.height(x, y)];
    const poses = [0.5, ...PITCHES].flatMap((pitch) => [0.25, -0.25].map((turn) => ({ target, yaw: heading + turn, pitch, distance: 105 })));
    return this.clearest(poses, this.someObjects(target));
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
