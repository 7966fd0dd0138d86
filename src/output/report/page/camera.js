// Where the eye is: a place that it looks at, a direction, a distance; and how pointers and keys move it.

class Camera {
  constructor(radius) {
    Object.assign(this, { target: [0, 0, 0], yaw: 0, pitch: 0.5, distance: 50, opening: 0.9, shift: [0, 0], radius });
  }

  /** Direction of the view in the plane. */
  ahead() { return [Math.cos(this.yaw), Math.sin(this.yaw)]; }

  eye() {
    const [x, y] = this.ahead(), flat = Math.cos(this.pitch) * this.distance;
    return [this.target[0] - x * flat, this.target[1] - y * flat, this.target[2] + Math.sin(this.pitch) * this.distance];
  }

  planes() {
    return [Math.max(0.15, this.distance / 80), this.distance * 2 + this.radius * 2.2 + 50];
  }

  /** The matrix for places relative to the eye, in the order of columns. */
  matrix(aspect) {
    const [x, y] = this.ahead(), c = Math.cos(this.pitch), s = Math.sin(this.pitch);
    const right = [y, -x, 0], up = [x * s, y * s, c], back = [-x * c, -y * c, s];
    const [near, far] = this.planes(), f = 1 / Math.tan(this.opening / 2);
    const depth = (near + far) / (near - far), depthShift = (2 * near * far) / (near - far);
    const matrix = new Float32Array(16);
    for (let axis = 0; axis < 3; axis++) {
      matrix[4 * axis] = (f / aspect) * right[axis];
      matrix[4 * axis + 1] = f * up[axis];
      matrix[4 * axis + 2] = depth * back[axis];
      matrix[4 * axis + 3] = -back[axis];
    }
    matrix[14] = depthShift;
    // Moves the picture, so that what is looked at is beside the card and not behind it.
    for (let axis = 0; axis < 3; axis++) for (const side of [0, 1]) matrix[4 * axis + side] += this.shift[side] * matrix[4 * axis + 3];
    return matrix;
  }

  /** Where a place is on a canvas of this size; null behind the eye. */
  project(place, width, height) {
    const m = this.matrix(width / height), eye = this.eye();
    const [x, y, z] = place.map((value, axis) => value - eye[axis]);
    const w = m[3] * x + m[7] * y + m[11] * z;
    if (w <= 0) return null;
    const at = (row) => (m[row] * x + m[row + 4] * y + m[row + 8] * z) / w;
    return [((at(0) + 1) / 2) * width, ((1 - at(1)) / 2) * height];
  }

  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.min(1.5707, Math.max(-0.35, this.pitch + pitch));
  }

  zoom(factor) {
    this.distance = Math.min(this.radius * 4 + 50, Math.max(1, this.distance * factor));
  }

  /** Moves to the right and ahead, in shares of the distance. */
  move(right, ahead) {
    const [x, y] = this.ahead();
    this.target[0] += (y * right + x * ahead) * this.distance;
    this.target[1] += (-x * right + y * ahead) * this.distance;
  }

  pose() { return { target: [...this.target], yaw: this.yaw, pitch: this.pitch, distance: this.distance, shift: this.shift }; }

  take(pose) { Object.assign(this, { shift: [0, 0] }, pose, { target: [...pose.target] }); }

  /** A pose between two. */
  between(from, to, share) {
    const ease = share * share * (3 - 2 * share);
    const mix = (a, b) => a + (b - a) * ease;
    const turn = Math.atan2(Math.sin(to.yaw - from.yaw), Math.cos(to.yaw - from.yaw));
    this.target = from.target.map((value, axis) => mix(value, to.target[axis]));
    this.yaw = from.yaw + turn * ease;
    this.pitch = mix(from.pitch, to.pitch);
    this.shift = from.shift.map((value, side) => mix(value, to.shift?.[side] ?? 0));
    this.distance = Math.exp(mix(Math.log(from.distance), Math.log(to.distance)));
  }
}

/** Lets pointers move something: `on` has turn, move, zoom, click and touched. */
function follow(canvas, on) {
  const down = new Map();
  let travelled = 0;
  const middle = () => { const all = [...down.values()]; return [all.reduce((sum, p) => sum + p.x, 0) / all.length, all.reduce((sum, p) => sum + p.y, 0) / all.length]; };
  const spread = () => { const [a, b] = down.values(); return Math.hypot(a.x - b.x, a.y - b.y); };
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    if (down.size === 0) travelled = 0;
    down.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
    on.touched();
  });
  canvas.addEventListener("pointermove", (event) => {
    const old = down.get(event.pointerId);
    if (!old) return;
    const two = down.size >= 2, before = two ? [middle(), spread()] : null;
    const dx = event.offsetX - old.x, dy = event.offsetY - old.y;
    travelled += Math.abs(dx) + Math.abs(dy);
    down.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
    if (travelled < 4) return;
    if (two) {
      const [[x, y], wide] = before, [nx, ny] = middle();
      on.move(nx - x, ny - y);
      if (down.size === 2 && wide > 10) on.zoom(wide / Math.max(10, spread()), nx, ny);
    } else if (event.buttons & 2 || event.shiftKey || event.buttons & 4) on.move(dx, dy);
    else on.turn(dx, dy);
  });
  const up = (event) => {
    if (!down.delete(event.pointerId)) return;
    if (event.type === "pointerup" && down.size === 0 && travelled < 5 && event.button === 0) on.click(event.offsetX, event.offsetY);
    if (down.size === 0) on.rest();
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    on.zoom(Math.exp(Math.max(-1, Math.min(1, event.deltaY * (event.deltaMode ? 0.05 : 0.0015)))), event.offsetX, event.offsetY);
    on.rest();
  }, { passive: false });
}
