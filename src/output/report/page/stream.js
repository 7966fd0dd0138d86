// Streams the points of the drive from `chainage view`: loads the nodes that the view needs, and lets others go.

/** The most points on the graphics card, beside the sample: about 75 MB (chosen). */
const MOST_POINTS = 3e6;
/** Nodes that are asked for at the same time. A browser opens six connections to a host. */
const AT_ONCE = 4;

class Stream {
  /**
   * The stream of a page, or null if there is none: the page was opened as a file, the run wrote no file with all
   * points or kept the LAS classes, or the server only serves files. Throws if the file cannot be used.
   */
  static async open(page, on) {
    const { cloud } = page;
    if (!cloud || !location.protocol.startsWith("http")) return null;
    const answer = await fetch(`${cloud.file}?tree`);
    if (answer.status === 404) return null;
    if (!answer.ok) throw new Error((await answer.text()).trim());
    if (answer.headers.get("Content-Type") !== "application/json") { await answer.body.cancel(); return null; }
    const tree = await answer.json();
    let points = 0;
    for (let at = 4; at < tree.nodes.length; at += 5) points += tree.nodes[at];
    if (points !== page.points) throw new Error(`${cloud.file} has ${shown(points)} points, but this report is of ${shown(page.points)}: it is of another run`);
    return new Stream(page, new Octree(tree, cloud), on);
  }

  /** `on.add(points)` makes points drawable; `on.changed()` is called when there is something new to draw. */
  constructor(page, octree, on) {
    Object.assign(this, { file: page.cloud.file, intensities: page.sample.intensities, all: page.points, octree, on, loading: new Map(), loaded: 0, wanted: [], turn: 0, problem: "", ended: false, drawn: { nodes: [], entries: [] } });
  }

  /** Chooses what the view needs, asks for what is missing, and returns what can be drawn. */
  update(camera, width, height) {
    this.turn++;
    this.wanted = this.octree.wanted(camera, width, height, MOST_POINTS);
    for (const node of this.wanted) node.seen = this.turn;
    for (const [node, abort] of this.loading) if (node.seen !== this.turn) abort.abort();
    this.ask();
    this.drawn = treeTexture(this.octree.root, (node) => node.state === "here" && node.seen === this.turn);
    return this.drawn;
  }

  /** Whether everything that the view needs is here. */
  get complete() { return this.loading.size === 0 && this.wanted.every((node) => node.state !== "away"); }

  ask() {
    if (this.ended) return;
    for (const node of this.wanted) {
      if (this.loading.size >= AT_ONCE) break;
      if (node.state === "away" && !this.loading.has(node)) this.load(node);
    }
  }

  async load(node) {
    const abort = new AbortController();
    this.loading.set(node, abort);
    try {
      const answer = await fetch(`${this.file}?node=${node.key}`, { signal: abort.signal });
      const bytes = answer.ok ? new Uint8Array(await answer.arrayBuffer()) : null;
      if (bytes) this.put(node, bytes);
      else {
        node.state = "failed";
        this.problem = (await answer.text()).trim();
      }
    } catch (error) {
      if (!abort.signal.aborted) {
        this.ended = true;
        this.problem = `The server does not answer (${error.message}). What was loaded stays`;
      }
    }
    this.loading.delete(node);
    this.on.changed();
  }

  put(node, bytes) {
    this.makeRoom(node.points);
    node.cloud = this.on.add(readStreamed(bytes, this.octree.toPage, this.intensities));
    node.state = "here";
    this.loaded += node.points;
  }

  /** Lets the nodes go that were not needed for the longest time, and of these the finest first. */
  makeRoom(points) {
    if (this.loaded + points <= MOST_POINTS) return;
    const spare = this.octree.nodes.filter((node) => node.cloud && node.seen !== this.turn);
    spare.sort((a, b) => a.seen - b.seen || b.level - a.level);
    for (const node of spare) {
      if (this.loaded + points <= MOST_POINTS) return;
      node.cloud.free();
      Object.assign(node, { cloud: null, state: "away" });
      this.loaded -= node.points;
    }
  }

  /** What a person reads about it. */
  get words() {
    const drawn = this.drawn.nodes.reduce((sum, node) => sum + node.points, 0);
    const text = `${shown(drawn)} of ${shown(this.all)} points in detail`;
    return this.problem ? `${text}. ${this.problem}` : this.complete ? text : `${text} …`;
  }
}
