// The octree of all points: its nodes in metres of the page, and which of them a view needs.

/** A node whose points are closer together on the screen than this, in pixels, is shown without the nodes below it. */
const FINEST_PX = 1.5;

class Octree {
  /** `tree` is the table of nodes from the server, `cloud` says how the units of the file become metres of the page. */
  constructor(tree, cloud) {
    const { origin_m, units_m } = cloud;
    this.low = [0, 1, 2].map((axis) => tree.origin[axis] * units_m[axis] - origin_m[axis]);
    this.side = units_m.map((unit) => tree.side * unit);
    this.spacing = tree.spacing * Math.max(...units_m);
    this.toPage = [0, 1, 2].map((axis) => [tree.scale[axis] * units_m[axis], tree.offset[axis] * units_m[axis] - origin_m[axis]]);
    const byKey = new Map();
    for (let at = 0; at < tree.nodes.length; at += 5) {
      const [level, x, y, z, points] = tree.nodes.slice(at, at + 5);
      const share = 2 ** -level, place = [x, y, z];
      const node = { key: `${level}-${x}-${y}-${z}`, level, octant: (x & 1) | ((y & 1) << 1) | ((z & 1) << 2), points, spacing: this.spacing * share, children: [], parent: null, state: points ? "away" : "here", cloud: null, worth: 0, seen: 0 };
      node.low = place.map((value, axis) => this.low[axis] + value * share * this.side[axis]);
      node.high = node.low.map((value, axis) => value + share * this.side[axis]);
      byKey.set(node.key, node);
      if (level === 0) { this.root = node; continue; }
      node.parent = byKey.get(`${level - 1}-${x >> 1}-${y >> 1}-${z >> 1}`);
      node.parent.children.push(node);
    }
    this.nodes = [...byKey.values()];
  }

  /**
   * The nodes that a view needs, the most useful first and never one before the node above it, with at most `most`
   * points. `worth` of a node becomes the distance on the screen, in pixels, between the points of the node above it.
   */
  wanted(camera, width, height, most) {
    if (!this.root) return [];
    const eye = camera.eye(), perMetre = height / (2 * Math.tan(camera.opening / 2));
    const seen = frustum(camera.matrix(width / height), eye);
    const heap = new Heap((node) => node.worth), found = [];
    this.root.worth = Infinity;
    heap.push(this.root);
    let points = 0;
    for (let node = heap.pop(); node; node = heap.pop()) {
      points += node.points;
      if (points > most) break;
      found.push(node);
      const apart = Math.hypot(...[0, 1, 2].map((axis) => Math.max(0, node.low[axis] - eye[axis], eye[axis] - node.high[axis])));
      const pixels = (node.spacing * perMetre) / Math.max(0.5, apart);
      if (pixels < FINEST_PX) continue;
      for (const child of node.children) {
        if (!seen(child)) continue;
        // Nearer nodes first: their own distance and not that of the node above them.
        const near = Math.hypot(...[0, 1, 2].map((axis) => Math.max(0, child.low[axis] - eye[axis], eye[axis] - child.high[axis])));
        child.worth = Math.min(node.worth, (node.spacing * perMetre) / Math.max(0.5, near));
        if (child.worth >= FINEST_PX) heap.push(child);
      }
    }
    return found;
  }
}

/** A function that says whether a node may be in the view. `matrix` is for places relative to the eye. */
function frustum(matrix, eye) {
  const row = (at) => [matrix[at], matrix[at + 4], matrix[at + 8], matrix[at + 12]];
  const [x, y, w] = [row(0), row(1), row(3)];
  // Left, right, below, above, behind: places where the clip coordinates are w +- x, w +- y, and w.
  const planes = [[w, x, 1], [w, x, -1], [w, y, 1], [w, y, -1]].map(([a, b, sign]) => a.map((value, at) => value + sign * b[at]));
  planes.push(w);
  return ({ low, high }) => planes.every((plane) => {
    // The corner that is furthest on the inner side.
    let sum = plane[3];
    for (let axis = 0; axis < 3; axis++) sum += plane[axis] * ((plane[axis] > 0 ? high[axis] : low[axis]) - eye[axis]);
    return sum > 0;
  });
}

/** The largest first. */
class Heap {
  constructor(value) {
    Object.assign(this, { value, items: [] });
  }

  push(item) {
    const { items, value } = this;
    let at = items.push(item) - 1;
    while (at > 0 && value(items[(at - 1) >> 1]) < value(item)) { items[at] = items[(at - 1) >> 1]; at = (at - 1) >> 1; }
    items[at] = item;
  }

  pop() {
    const { items, value } = this;
    const first = items[0], last = items.pop();
    if (items.length === 0) return first;
    let at = 0;
    for (;;) {
      let child = 2 * at + 1;
      if (child >= items.length) break;
      if (child + 1 < items.length && value(items[child + 1]) > value(items[child])) child++;
      if (value(items[child]) <= value(last)) break;
      items[at] = items[child];
      at = child;
    }
    items[at] = last;
    return first;
  }
}

/**
 * The nodes in the order of the texture that the shader walks through: the root first, and the children of a node one
 * after the other. An entry has two numbers: which octants have a node (8 bits) and where everything is shown (8 bits),
 * and the place of the first child.
 */
function treeTexture(root, isDrawn) {
  const nodes = root && isDrawn(root) ? [root] : [];
  const entries = [];
  for (let at = 0; at < nodes.length; at++) {
    const children = nodes[at].children.filter(isDrawn).sort((a, b) => a.octant - b.octant);
    const drawn = children.reduce((bits, child) => bits | (1 << child.octant), 0);
    const deeper = nodes[at].children.reduce((bits, child) => bits | (1 << child.octant), 0);
    entries.push(drawn | ((~deeper & 255) << 8), nodes.length);
    nodes.push(...children);
  }
  return { nodes, entries };
}
