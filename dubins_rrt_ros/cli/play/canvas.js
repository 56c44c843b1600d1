// The picture: map, tree, paths, vehicle, start and goal. Positions are in metres; the y axis points up.

const COLOURS = { free: "#ffffff", obstacle: "#454b54", tree: "#7fa9d1", path: "#d55e00", first: "#8a4b08", start: "#009e73",
                  goal: "#0072b2", via: "#7b3294", cause: "#e69f00", swept: "#d55e0026" };
const HANDLE = 34;  // length of the arrows that turn start and goal [pixel]
const NEAR = 16;    // distance within which a handle is taken [pixel]

export class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.map = null;
    this.start = [0, 0, 0];
    this.goal = [0, 0, 0];
    this.via = [];
    this.unsent = new Set();  // those of start and goal that a watched node knows nothing of
    this.selected = "goal";
    this.answer = null;
    this.first = null;
    this.tree = null;
    this.vehicle = { radius: 0.2, footprint: [] };
    this.stroke = null;
    this.driver = null;
    this.scale = 1;
    this.centre = [0, 0];
    this.isFitted = true;
    new ResizeObserver(() => { if (this.isFitted) { this.fit(); } this.request(); }).observe(canvas);
  }

  setMap(map) {
    this.map = map;
    this.shape = null;
    this.image = null;
    if (map.rings) {
      this.shape = new Path2D();
      for (const ring of map.rings) {
        for (let i = 0; i < ring.length; i += 2) { this.shape[i ? "lineTo" : "moveTo"](ring[i], ring[i + 1]); }
        this.shape.closePath();
      }
    } else {
      const image = new Image();
      image.onload = () => { this.image = image; this.image.place = map; this.request(); };
      image.src = map.picture;
    }
    this.request();
  }

  fit() {
    if (!this.map) { return; }
    const [x0, y0] = this.map.low, [x1, y1] = this.map.high;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.scale = 0.94 * Math.min(width / (x1 - x0), height / (y1 - y0));
    this.centre = [(x0 + x1) / 2, (y0 + y1) / 2];
    this.isFitted = true;
    this.request();
  }

  zoom(factor, x, y) {
    const [wx, wy] = this.toWorld(x, y);
    this.scale *= factor;
    const [nx, ny] = this.toWorld(x, y);
    this.centre = [this.centre[0] + wx - nx, this.centre[1] + wy - ny];
    this.isFitted = false;
    this.request();
  }

  pan(dx, dy) {
    this.centre = [this.centre[0] - dx / this.scale, this.centre[1] + dy / this.scale];
    this.isFitted = false;
    this.request();
  }

  toWorld(x, y) {
    return [this.centre[0] + (x - this.canvas.clientWidth / 2) / this.scale, this.centre[1] - (y - this.canvas.clientHeight / 2) / this.scale];
  }

  toScreen(x, y) {
    return [this.canvas.clientWidth / 2 + (x - this.centre[0]) * this.scale, this.canvas.clientHeight / 2 - (y - this.centre[1]) * this.scale];
  }

  tip(pose) {
    const [x, y] = this.toScreen(pose[0], pose[1]);
    const length = Math.max(HANDLE, this.reach() * this.scale + 14);
    return [x + length * Math.cos(pose[2]), y - length * Math.sin(pose[2])];
  }

  reach() {
    return this.vehicle.footprint.length ? Math.max(...this.vehicle.footprint.map((corner) => corner[0])) : this.vehicle.radius;
  }

  // The number of the waypoint at a place on the screen, or -1.
  pickWaypoint(x, y) {
    return this.via.findIndex((point) => Math.hypot(...minus(this.toScreen(...point), [x, y])) < NEAR);
  }

  // What is at a place on the screen: [name, part], or null.
  pick(x, y) {
    let best = null, least = Infinity;
    for (const name of ["goal", "start"]) {
      const pose = this[name];
      const body = Math.hypot(...minus(this.toScreen(pose[0], pose[1]), [x, y]));
      const tip = Math.hypot(...minus(this.tip(pose), [x, y]));
      const inside = Math.max(NEAR, this.vehicle.radius * this.scale);
      if (tip < NEAR && tip < least) { least = tip; best = [name, "turn"]; }
      if (body < inside && body < least) { least = body; best = [name, "move"]; }
    }
    return best;
  }

  // Draw at the next frame, once.
  request() {
    if (this.isDue) { return; }
    this.isDue = true;
    requestAnimationFrame((now) => {
      this.isDue = false;
      this.draw(now);
      if (this.onDrawn) { this.onDrawn(); }
      if (this.driver) { this.request(); }
    });
  }

  draw(now) {
    const { canvas, context } = this, ratio = window.devicePixelRatio || 1;
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = COLOURS.obstacle;
    context.fillRect(0, 0, width, height);
    if (!this.map) { return; }
    const scale = this.scale * ratio;
    context.setTransform(scale, 0, 0, -scale, width / 2 - this.centre[0] * scale, height / 2 + this.centre[1] * scale);
    this.pixel = 1 / this.scale;
    this.drawMap();
    this.drawStroke();
    this.drawTree();
    this.drawPaths();
    this.drawWaypoints();
    this.drawPose(this.start, COLOURS.start, "start");
    this.drawPose(this.goal, COLOURS.goal, "goal");
    this.drawCause();
    if (this.driver) { this.drawDriver(now); }
  }

  drawMap() {
    const { context } = this;
    if (this.shape) {
      context.fillStyle = COLOURS.free;
      context.fill(this.shape, "evenodd");
    } else if (this.image) {
      const { origin, size } = this.image.place;
      context.save();
      context.translate(origin[0], origin[1]);
      context.rotate(origin[2]);
      context.scale(1, -1);
      context.imageSmoothingEnabled = false;
      context.drawImage(this.image, 0, -size[1], size[0], size[1]);
      context.restore();
    }
  }

  drawStroke() {
    if (!this.stroke) { return; }
    this.line(this.stroke.points, this.stroke.obstacle ? COLOURS.obstacle : COLOURS.free, 2 * this.stroke.radius);
  }

  drawTree() {
    if (!this.tree) { return; }
    const { context, tree } = this;
    context.beginPath();
    for (let i = 0; i + 3 < tree.length; i += 4) { context.moveTo(tree[i], tree[i + 1]); context.lineTo(tree[i + 2], tree[i + 3]); }
    context.strokeStyle = COLOURS.tree;
    context.lineWidth = 0.8 * this.pixel;
    context.stroke();
  }

  drawPaths() {
    const { context } = this;
    if (this.first) {
      context.setLineDash([6 * this.pixel, 5 * this.pixel]);
      this.line(this.first, COLOURS.first, 1.6 * this.pixel);
      context.setLineDash([]);
    }
    const path = this.answer ? this.answer.poses : [];
    if (!path.length) { return; }
    this.drawSwept(path);
    this.line(path, COLOURS.path, 3.5 * this.pixel);
  }

  drawSwept(path) {
    const { footprint, radius } = this.vehicle;
    if (!footprint.length) {
      this.line(path, COLOURS.swept, 2 * radius);
      return;
    }
    this.context.beginPath();
    path.forEach((pose) => this.addOutline(pose));  // all turn the same way, so that together they fill their union
    this.context.fillStyle = COLOURS.swept;
    this.context.fill();
  }

  line(points, colour, width) {
    const { context } = this;
    context.beginPath();
    points.forEach((point, i) => context[i ? "lineTo" : "moveTo"](point[0], point[1]));
    if (points.length === 1) { context.lineTo(points[0][0], points[0][1]); }
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.lineCap = context.lineJoin = "round";
    context.stroke();
  }

  outline(pose) {
    this.context.beginPath();
    this.addOutline(pose);
  }

  addOutline([x, y, theta]) {
    const { context } = this, { footprint, radius } = this.vehicle;
    if (!footprint.length) { context.arc(x, y, radius, 0, 2 * Math.PI); return; }
    const cos = Math.cos(theta), sin = Math.sin(theta);
    footprint.forEach(([ahead, left], i) => {
      context[i ? "lineTo" : "moveTo"](x + ahead * cos - left * sin, y + ahead * sin + left * cos);
    });
    context.closePath();
  }

  drawWaypoints() {
    this.via.forEach(([x, y], i) => {
      this.context.beginPath();
      this.context.arc(x, y, 8 * this.pixel, 0, 2 * Math.PI);
      this.context.fillStyle = COLOURS.via;
      this.context.fill();
      this.write(String(i + 1), x, y, COLOURS.via);
    });
  }

  drawPose(pose, colour, name) {
    const { context, pixel } = this, tip = this.toWorld(...this.tip(pose));
    context.globalAlpha = this.unsent.has(name) ? 0.45 : 1;
    this.outline(pose);
    context.fillStyle = colour + "50";
    context.fill();
    context.strokeStyle = colour;
    context.lineWidth = (this.selected === name ? 3 : 1.6) * pixel;
    context.stroke();
    this.line([pose, tip], "#ffffff", 6 * pixel);
    this.line([pose, tip], colour, 3.5 * pixel);
    for (const [place, size] of [[pose, 5], [tip, 8]]) {
      context.beginPath();
      context.arc(place[0], place[1], size * pixel, 0, 2 * Math.PI);
      context.fillStyle = colour;
      context.fill();
      context.strokeStyle = "#ffffff";
      context.lineWidth = 1.5 * pixel;
      context.stroke();
    }
    const isUp = tip[1] >= pose[1];  // behind the start and ahead of the goal no path runs
    if (name === "goal") { this.write(name, ...tip, colour, isUp); } else { this.write(name, pose[0], pose[1], colour, !isUp); }
    context.globalAlpha = 1;
  }

  // Write below a place, or above it.
  write(text, x, y, colour, isAbove = false) {
    const { context } = this, [column, row] = this.toScreen(x, y), ratio = window.devicePixelRatio || 1;
    context.save();
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.font = "600 14px system-ui, sans-serif";
    context.textAlign = "center";
    context.lineWidth = 4;
    context.strokeStyle = "#ffffff";
    const line = row + (isAbove ? -16 : 26);
    context.strokeText(text, column, line);
    context.fillStyle = colour;
    context.fillText(text, column, line);
    context.restore();
  }

  drawCause() {
    const place = this.answer && this.answer.location;
    if (!place) { return; }
    const { context } = this;
    context.beginPath();
    context.arc(place[0], place[1], 11 * this.pixel, 0, 2 * Math.PI);  // around it, so that it stays in sight
    context.strokeStyle = COLOURS.cause;
    context.lineWidth = 4 * this.pixel;
    context.stroke();
  }

  // Drive along the path, at such a speed that it takes some seconds.
  drive() {
    if (this.answer && this.answer.poses.length > 1) { this.driver = { began: performance.now() }; this.request(); }
  }

  drawDriver(now) {
    const path = this.answer ? this.answer.poses : [], { context } = this;
    const share = (now - this.driver.began) / 6000;
    if (share >= 1 || path.length < 2) { this.driver = null; return; }
    const lengths = [0];
    for (let i = 1; i < path.length; i++) { lengths.push(lengths[i - 1] + Math.hypot(...minus(path[i], path[i - 1]))); }
    const driven = Math.max(0, share) * lengths[lengths.length - 1];
    const i = Math.max(1, lengths.findIndex((length) => length >= driven));
    const [from, to] = [path[i - 1], path[i]], part = (driven - lengths[i - 1]) / (lengths[i] - lengths[i - 1] || 1);
    const turn = Math.atan2(Math.sin(to[2] - from[2]), Math.cos(to[2] - from[2]));
    const pose = [from[0] + part * (to[0] - from[0]), from[1] + part * (to[1] - from[1]), from[2] + part * turn];
    this.outline(pose);
    context.fillStyle = "#8a2be2";
    context.fill();
    this.line([pose, [pose[0] + this.reach() * Math.cos(pose[2]), pose[1] + this.reach() * Math.sin(pose[2])]], "#ffffff", 2.5 * this.pixel);
  }
}

function minus(a, b) { return [a[0] - b[0], a[1] - b[1]]; }
