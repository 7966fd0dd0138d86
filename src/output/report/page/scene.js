// Draws the points with WebGL 2: the sample, and the nodes that are streamed; shading by depth, picking by number.

const POINT_VERTEX = `#version 300 es
layout(location = 0) in vec3 place;
layout(location = 1) in vec4 look;
layout(location = 2) in uint key;
uniform mat4 camera;
uniform vec3 eye;
uniform vec2 pixels;   // of a metre at a distance of one metre; largest size of a point
uniform uint chosen;
uniform vec3 accent;
uniform bool numbers;
uniform highp usampler2D tree;   // entries of the nodes that are drawn: see treeTexture in octree.js
uniform int nodes;
uniform vec3 low;      // of the octree, and its edges, in metres
uniform vec3 side;
uniform float coarsest;
uniform bool sampled;
flat out vec4 colour;
// Distance between the streamed points around this place; 0 where all points are drawn, below 0 where none is.
float streamed() {
  vec3 at = (place - low) / side;
  if (nodes == 0 || any(lessThan(at, vec3(0.0))) || any(greaterThanEqual(at, vec3(1.0)))) return -1.0;
  float apart = coarsest;
  int node = 0;
  for (int level = 0; level < 24; level++) {
    uvec2 entry = texelFetch(tree, ivec2(node & 255, node >> 8), 0).rg;
    at *= 2.0;
    uvec3 upper = min(uvec3(at), uvec3(1u));
    at -= vec3(upper);
    uint octant = upper.x | upper.y << 1 | upper.z << 2;
    if ((entry.r >> (octant + 8u) & 1u) == 1u) return 0.0;
    if ((entry.r >> octant & 1u) == 0u) return apart;
    uint before = entry.r & 255u & ((1u << octant) - 1u);
    before -= before >> 1 & 0x55u;
    before = (before & 0x33u) + (before >> 2 & 0x33u);
    node = int(entry.g + (before + (before >> 4) & 15u));
    apart *= 0.5;
  }
  return apart;
}
void main() {
  gl_Position = camera * vec4(place - eye, 1.0);
  // The alpha channel holds the distance between points: eighths of powers of two from 1/64 m; 0 hides the point.
  float apart = exp2(look.a * 255.0 / 8.0 - 6.0);
  float detail = streamed();
  // Where the streamed points are as dense as the sample, they are shown instead of it.
  bool replaced = sampled && detail >= 0.0 && detail <= apart;
  if (!sampled) apart = max(apart, detail);
  gl_PointSize = clamp(1.3 * apart * pixels.x / max(gl_Position.w, 0.01), 1.6, pixels.y);
  colour = vec4(look.rgb, 1.0);
  if (numbers) colour = vec4(uvec4(key, key >> 8, key >> 16, key >> 24) & 255u) / 255.0;
  else if (chosen != 0u) colour.rgb = key == chosen ? mix(look.rgb, accent, 0.75) : mix(look.rgb, vec3(dot(look.rgb, vec3(0.33))), 0.55);
  if (look.a == 0.0 || replaced) gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
}`;
const POINT_FRAGMENT = `#version 300 es
precision mediump float;
flat in vec4 colour;
out vec4 pixel;
void main() {
  vec2 off = gl_PointCoord - 0.5;
  if (dot(off, off) > 0.25) discard;
  pixel = colour;
}`;
const LINE_VERTEX = `#version 300 es
layout(location = 0) in vec3 place;
uniform mat4 camera;
uniform vec3 eye;
void main() { gl_Position = camera * vec4(place - eye, 1.0); }`;
const LINE_FRAGMENT = `#version 300 es
precision mediump float;
uniform vec4 colour;
out vec4 pixel;
void main() { pixel = colour; }`;
const SCREEN_VERTEX = `#version 300 es
out vec2 at;
void main() { at = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0; gl_Position = vec4(at * 2.0 - 1.0, 0.0, 1.0); }`;
// Eye-dome lighting (Boucheny 2009): a pixel is darker, the more its neighbours are nearer to the eye.
const SCREEN_FRAGMENT = `#version 300 es
precision highp float;
in vec2 at;
uniform sampler2D colours;
uniform sampler2D depths;
uniform vec2 planes;
uniform vec2 pace;
uniform vec3 sky;
uniform vec3 haze;
out vec4 pixel;
float far(vec2 place) {
  float depth = texture(depths, place).r;
  return log2(planes.x * planes.y / (planes.y - depth * (planes.y - planes.x)));
}
void main() {
  float own = far(at);
  float sum = 0.0;
  for (int i = 0; i < 8; i++) {
    float angle = float(i) * 0.7853982;
    sum += max(0.0, own - far(at + vec2(cos(angle), sin(angle)) * pace));
  }
  float shade = exp(-min(sum, 6.0) * 0.42);
  vec4 found = texture(colours, at);
  vec3 air = mix(haze, sky, at.y);
  vec3 back = mix(air, air * 0.86, 1.0 - shade);
  pixel = vec4(texture(depths, at).r >= 1.0 ? back : found.rgb * shade, 1.0);
}`;

/** The most points that are drawn while the camera moves; the time of a frame adapts it. */
const FEWEST_MOVING = 60000;

class Scene {
  constructor(canvas, points, spacings) {
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, powerPreference: "high-performance", preserveDrawingBuffer: true });
    if (!gl) throw new Error("it needs WebGL 2, which this browser does not give");
    Object.assign(this, { canvas, gl, chosen: 0, moving: points.count, axisLines: [], nodes: [], octree: null });
    this.pointProgram = this.program(POINT_VERTEX, POINT_FRAGMENT);
    this.lineProgram = this.program(LINE_VERTEX, LINE_FRAGMENT);
    this.screenProgram = this.program(SCREEN_VERTEX, SCREEN_FRAGMENT);
    this.sample = new Cloud(gl, points, spacings);
    this.tree = gl.createTexture();
    this.stream({ nodes: [], entries: [] }, null);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
    this.lines = gl.createVertexArray();
    this.lineBuffer = gl.createBuffer();
    gl.bindVertexArray(this.lines);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.lineBuffer);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    this.nothing = gl.createVertexArray();
    this.targets = { width: 0, height: 0 };
  }

  program(vertex, fragment) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const places = {};
    for (let at = 0; at < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); at++) {
      const { name } = gl.getActiveUniform(program, at);
      places[name] = gl.getUniformLocation(program, name);
    }
    return { program, places };
  }

  /** What is streamed: nodes with their clouds, and the entries for the shader. */
  stream({ nodes, entries }, octree) {
    const { gl } = this;
    this.nodes = nodes;
    this.octree = octree;
    const rows = Math.max(1, Math.ceil(entries.length / 512));
    const filled = new Uint32Array(512 * rows);
    filled.set(entries);
    gl.activeTexture(gl.TEXTURE2);
    gl.bindTexture(gl.TEXTURE_2D, this.tree);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RG32UI, 256, rows, 0, gl.RG_INTEGER, gl.UNSIGNED_INT, filled);
  }

  /** Points that can be drawn. */
  get count() { return this.nodes.reduce((sum, node) => sum + (node.cloud?.count ?? 0), this.sample.count); }

  /** Paints the sample at once, and streamed nodes for a few milliseconds. Returns whether all are painted. */
  paint(colour, version) {
    const until = performance.now() + 12;
    if (this.sample.version !== version) this.sample.paint(colour, version);
    for (const { cloud } of this.nodes) {
      if (!cloud || cloud.version === version) continue;
      if (performance.now() > until) return false;
      cloud.paint(colour, version);
    }
    return true;
  }

  resize() {
    const { gl, canvas, targets } = this;
    const scale = Math.min(devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(canvas.clientWidth * scale)), height = Math.max(1, Math.round(canvas.clientHeight * scale));
    if (targets.width === width && targets.height === height) return;
    canvas.width = width;
    canvas.height = height;
    for (const texture of [targets.colours, targets.depths]) gl.deleteTexture(texture);
    gl.deleteFramebuffer(targets.frame);
    const texture = (inner, format, type) => {
      const made = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, made);
      gl.texImage2D(gl.TEXTURE_2D, 0, inner, width, height, 0, format, type, null);
      for (const [name, value] of [[gl.TEXTURE_MIN_FILTER, gl.NEAREST], [gl.TEXTURE_MAG_FILTER, gl.NEAREST], [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) gl.texParameteri(gl.TEXTURE_2D, name, value);
      return made;
    };
    const colours = texture(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE);
    const depths = texture(gl.DEPTH_COMPONENT24, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT);
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, colours, 0);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, depths, 0);
    this.targets = { width, height, scale, colours, depths, frame };
  }

  /** The points into the frame, as colours or as numbers. */
  drawPoints(camera, numbers, share) {
    const { gl, targets, pointProgram: { program, places } } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, targets.frame);
    gl.viewport(0, 0, targets.width, targets.height);
    gl.clearColor(0, 0, 0, 0);
    gl.enable(gl.DEPTH_TEST);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(program);
    gl.uniformMatrix4fv(places.camera, false, camera.matrix(targets.width / targets.height));
    gl.uniform3fv(places.eye, camera.eye());
    // Fewer points are drawn larger, so that surfaces stay closed.
    const larger = Math.min(3, Math.sqrt(1 / Math.max(0.01, share)));
    gl.uniform2f(places.pixels, (larger * targets.height) / (2 * Math.tan(camera.opening / 2)), 18 * targets.scale);
    gl.uniform1ui(places.chosen, this.chosen);
    gl.uniform3fv(places.accent, this.accent);
    gl.uniform1i(places.numbers, numbers);
    gl.uniform1i(places.tree, 2);
    gl.uniform1i(places.nodes, this.nodes.length);
    gl.uniform3fv(places.low, this.octree?.low ?? [0, 0, 0]);
    gl.uniform3fv(places.side, this.octree?.side ?? [1, 1, 1]);
    gl.uniform1f(places.coarsest, this.octree?.spacing ?? 1);
    gl.activeTexture(gl.TEXTURE2);
    gl.bindTexture(gl.TEXTURE_2D, this.tree);
    gl.uniform1i(places.sampled, true);
    this.sample.draw(share);
    gl.uniform1i(places.sampled, false);
    for (const { cloud } of this.nodes) cloud?.draw(share);
  }

  drawLines(camera, vertices, kind, colour) {
    if (vertices.length === 0) return;
    const { gl, targets, lineProgram: { program, places } } = this;
    gl.useProgram(program);
    gl.uniformMatrix4fv(places.camera, false, camera.matrix(targets.width / targets.height));
    gl.uniform3fv(places.eye, camera.eye());
    gl.uniform4fv(places.colour, colour);
    gl.bindVertexArray(this.lines);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.lineBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, vertices, gl.STREAM_DRAW);
    gl.drawArrays(kind, 0, vertices.length / 3);
  }

  /** One picture. While the camera moves, fewer points are drawn. */
  draw(camera, theme, box, moving) {
    const { gl } = this;
    this.resize();
    const { targets, screenProgram: { program, places } } = this;
    const began = performance.now();
    const all = this.count, share = moving ? Math.min(1, this.moving / Math.max(1, all)) : 1;
    this.accent = theme.accent;
    this.drawPoints(camera, false, share);
    for (const line of this.axisLines) this.drawLines(camera, line, gl.LINE_STRIP, [...theme.accent, 1]);
    if (box) this.drawLines(camera, box, gl.LINES, [...theme.accent, 1]);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, targets.width, targets.height);
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(program);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, targets.colours);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, targets.depths);
    gl.uniform1i(places.colours, 0);
    gl.uniform1i(places.depths, 1);
    gl.uniform2f(places.planes, ...camera.planes());
    gl.uniform2f(places.pace, (1.4 * targets.scale) / targets.width, (1.4 * targets.scale) / targets.height);
    gl.uniform3fv(places.sky, theme.sky);
    gl.uniform3fv(places.haze, theme.haze);
    gl.bindVertexArray(this.nothing);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    if (moving) {
      gl.finish();
      const seconds = (performance.now() - began) / 1000;
      const fitting = all * share * (seconds > 0.05 ? 0.7 : seconds < 0.02 ? 1.4 : 1);
      this.moving = Math.round(Math.min(all, Math.max(FEWEST_MOVING, fitting)));
    }
  }

  /** The key of the point nearest to a place on the canvas, in its own pixels; 0 where there is none. */
  pick(camera, x, y) {
    const { gl, targets } = this;
    this.resize();
    this.drawPoints(camera, true, 1);
    const reach = Math.round(7 * this.targets.scale), side = 2 * reach + 1;
    const left = Math.round(x * this.targets.scale) - reach, bottom = this.targets.height - Math.round(y * this.targets.scale) - 1 - reach;
    const seen = new Uint8Array(4 * side * side);
    gl.readPixels(left, bottom, side, side, gl.RGBA, gl.UNSIGNED_BYTE, seen);
    let best = 0, nearest = Infinity;
    for (let at = 0; at < side * side; at++) {
      const key = (seen[4 * at] | (seen[4 * at + 1] << 8) | (seen[4 * at + 2] << 16) | (seen[4 * at + 3] << 24)) >>> 0;
      const apart = ((at % side) - reach) ** 2 + (Math.floor(at / side) - reach) ** 2;
      if (key > 1 && apart < nearest) { nearest = apart; best = key; }
    }
    return best;
  }
}
