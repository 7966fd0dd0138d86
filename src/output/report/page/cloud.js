// Points on the graphics card: places and keys once, looks (colour, and distance between points) when they change.

/** The numbers from 0 in a mixed order, so that any first part of them is all of them, thinned evenly. */
function mixedOrder(count) {
  const order = new Uint32Array(count);
  const divisor = (a, b) => (b ? divisor(b, a % b) : a);
  let stride = Math.max(1, Math.floor(count * 0.618034));
  while (count > 1 && divisor(stride, count) !== 1) stride++;
  for (let at = 0, from = 0; at < count; at++, from = (from + stride) % count) order[at] = from;
  return order;
}

class Cloud {
  /** `spacings` gives the distance between the points of a key, in metres. */
  constructor(gl, points, spacings) {
    Object.assign(this, { gl, points, count: points.count, version: -1 });
    const { count } = points, order = (this.order = mixedOrder(count));
    const places = new Float32Array(3 * count), keys = new Uint32Array(count);
    this.spacings = new Uint8Array(count);
    const codes = new Map();
    for (let at = 0; at < count; at++) {
      const from = order[at], key = points.keys[from];
      for (let axis = 0; axis < 3; axis++) places[3 * at + axis] = points.places[3 * from + axis];
      keys[at] = key;
      let code = codes.get(key);
      if (code === undefined) codes.set(key, (code = Math.max(1, Math.min(255, Math.round(8 * (Math.log2(spacings(key)) + 6))))));
      this.spacings[at] = code;
    }
    this.look = new Uint8Array(4 * count);
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    this.buffers = [[places, gl.STATIC_DRAW], [this.look, gl.DYNAMIC_DRAW], [keys, gl.STATIC_DRAW]].map(([data, usage], number) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, data, usage);
      gl.enableVertexAttribArray(number);
      if (number === 0) gl.vertexAttribPointer(number, 3, gl.FLOAT, false, 0, 0);
      else if (number === 1) gl.vertexAttribPointer(number, 4, gl.UNSIGNED_BYTE, true, 0, 0);
      else gl.vertexAttribIPointer(number, 1, gl.UNSIGNED_INT, 0, 0);
      return buffer;
    });
  }

  /** Colours every point: `colour(points, point, rgba, at)` writes red, green and blue, and returns whether the point is shown. */
  paint(colour, version) {
    const { gl, look, order, spacings, points } = this;
    for (let at = 0; at < order.length; at++) look[4 * at + 3] = colour(points, order[at], look, 4 * at) ? spacings[at] : 0;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[1]);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, look);
    this.version = version;
  }

  /** Draws the first points, in the mixed order. */
  draw(share) {
    const { gl } = this;
    gl.bindVertexArray(this.array);
    gl.drawArrays(gl.POINTS, 0, Math.ceil(this.count * share));
  }

  free() {
    for (const buffer of this.buffers) this.gl.deleteBuffer(buffer);
    this.gl.deleteVertexArray(this.array);
  }
}
