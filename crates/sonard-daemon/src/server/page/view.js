// Which part of the floor the plan shows, and where a point of it is on the screen.

const MARGIN_PX = 26;
/** Below, the scale has its place. */
const FOOT_PX = 40;
/** In the usual view the room takes up at least a quarter of the plan. */
const NEAR = 1.5;
/** Pixels a metre that can be zoomed to: from a square kilometre to a millimetre. */
const [LEAST_SCALE, MOST_SCALE] = [0.5, 40000];

export class View {
  constructor() {
    /** What is shown: "near" (room and the readings around it), "room" or "all". */
    this.what = "near";
    /** Left, low, right, high, metres. @type {number[] | null} */
    this.box = null;
    /** Whether somebody zoomed or moved it: then it stays until it is fitted again. */
    this.moved = false;
    this.width = 0;
    this.height = 0;
    this.scale = 1;
    this.x0 = 0;
    this.y0 = 0;
  }

  /**
   * Sets scale and origin. `room` and `readings` are points, metres; `grow` keeps what is in view now.
   * @param {number[][]} room
   * @param {number[][]} readings
   * @param {boolean} grow
   */
  fit(room, readings, grow) {
    if (this.moved && this.box) return;
    this.moved = false;
    const inner = boxOf(room.length ? room : readings) ?? boxOf([[-1, -1], [1, 1]]);
    const around = { room: 0.06, near: NEAR, all: Infinity }[this.what] * Math.max(...sizes(inner));
    const most = [inner[0] - around, inner[1] - around, inner[2] + around, inner[3] + around];
    const wanted = this.what === "room" ? most : clip(union(inner, boxOf(readings)), most);
    this.box = grow && this.box ? union(this.box, wanted) : wanted;
    const [left, low, right, high] = this.box;
    const [across, up] = sizes(this.box).map((size) => Math.max(size, 0.2));
    this.scale = Math.min((this.width - 2 * MARGIN_PX) / across, (this.height - MARGIN_PX - FOOT_PX) / up);
    this.x0 = this.width / 2 - (this.scale * (left + right)) / 2;
    this.y0 = (this.height + MARGIN_PX - FOOT_PX) / 2 + (this.scale * (low + high)) / 2;
  }

  /** Fits room and readings ("near"), the room or all, from now on. @param {string} what */
  show(what) {
    [this.what, this.box, this.moved] = [what, null, false];
  }

  /** What is in the middle stays there if somebody moved it there. @param {number} width @param {number} height */
  resize(width, height) {
    if (this.moved) this.pan((width - this.width) / 2, (height - this.height) / 2);
    [this.width, this.height] = [width, height];
  }

  /** The point at a pixel stays there. @param {number} factor @param {number[]} px */
  zoom(factor, [x, y]) {
    const scale = Math.max(LEAST_SCALE, Math.min(MOST_SCALE, this.scale * factor));
    const by = scale / this.scale;
    this.scale = scale;
    this.x0 = x + by * (this.x0 - x);
    this.y0 = y + by * (this.y0 - y);
    this.moved = true;
  }

  /** @param {number} dx pixels to the right @param {number} dy pixels down */
  pan(dx, dy) {
    this.x0 += dx;
    this.y0 += dy;
    this.moved = true;
  }

  /** Where a point is, pixels. @param {number[]} point @returns {[number, number]} */
  px([x, y]) {
    return [this.x0 + this.scale * x, this.y0 - this.scale * y];
  }

  /** The point at a pixel, metres. @param {number[]} px @returns {[number, number]} */
  world([x, y]) {
    return [(x - this.x0) / this.scale, (this.y0 - y) / this.scale];
  }

  /** @param {number[]} px */
  isBeyond([x, y]) {
    return x < 2 || y < 2 || x > this.width - 2 || y > this.height - 2;
  }

  /** Whether a reading there would widen the view. */
  wouldGrow(point) {
    if (this.what === "room" || this.moved || !this.box) return false;
    /** @type {(point: number[], box: number[]) => boolean} */
    const inside = ([x, y], [left, low, right, high]) => x >= left && y >= low && x <= right && y <= high;
    return this.isBeyond(this.px(point)) && !inside(point, this.box);
  }

  /**
   * Where a ray from a pixel leaves the view; `turn` in radians clockwise from the right.
   * @param {number[]} px
   * @param {number} turn
   * @returns {[number, number]}
   */
  border([x, y], turn) {
    const inset = 3;
    const [dx, dy] = [Math.cos(turn), Math.sin(turn)];
    const until = (at, along, most) =>
      along > 1e-9 ? (most - inset - at) / along : along < -1e-9 ? (inset - at) / along : Infinity;
    const length = Math.max(0, Math.min(until(x, dx, this.width), until(y, dy, this.height)));
    return [x + length * dx, y + length * dy];
  }
}

function boxOf(points) {
  if (!points.length) return null;
  const [xs, ys] = [0, 1].map((axis) => points.map((point) => point[axis]));
  const least = (values) => values.reduce((a, b) => Math.min(a, b));
  const most = (values) => values.reduce((a, b) => Math.max(a, b));
  return [least(xs), least(ys), most(xs), most(ys)];
}

/** @param {number[]} box */
const sizes = ([left, low, right, high]) => [right - left, high - low];

const union = (one, other) =>
  other ? one.map((value, i) => (i < 2 ? Math.min(value, other[i]) : Math.max(value, other[i]))) : one;

const clip = (box, most) => box.map((value, i) => (i < 2 ? Math.max(value, most[i]) : Math.min(value, most[i])));
