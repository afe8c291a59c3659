// View of the floor plan: visible area, and conversion between world metres and screen pixels.

const MARGIN_PX = 26;
/** Bottom margin, with room for the scale bar. */
const FOOT_PX = 40;
/** Margin around the room in the mode "near", in units of its size: the room fills at least a quarter of the plan. */
const NEAR = 1.5;
/** Zoom limits, pixels per metre: from a kilometre to a millimetre. */
const [MIN_SCALE, MAX_SCALE] = [0.5, 40000];

export class View {
  constructor() {
    /** Fitted area: "near" (room and the readings around it), "room" or "all". */
    this.mode = "near";
    /** Fitted area as left, bottom, right, top, metres. @type {number[] | null} */
    this.box = null;
    /** Set by pan and zoom; a moved view stays until it is fitted again. */
    this.moved = false;
    this.width = 0;
    this.height = 0;
    this.scale = 1;
    this.x0 = 0;
    this.y0 = 0;
  }

  /**
   * Sets scale and origin. `room` and `readings` are points, metres; `grow` keeps the current area in view.
   * @param {number[][]} room
   * @param {number[][]} readings
   * @param {boolean} grow
   */
  fit(room, readings, grow) {
    if (this.moved && this.box) return;
    this.moved = false;
    const inner = boxOf(room.length ? room : readings) ?? boxOf([[-1, -1], [1, 1]]);
    const margin = { room: 0.06, near: NEAR, all: Infinity }[this.mode] * Math.max(...sizes(inner));
    const limit = [inner[0] - margin, inner[1] - margin, inner[2] + margin, inner[3] + margin];
    const fitted = this.mode === "room" ? limit : clip(union(inner, boxOf(readings)), limit);
    this.box = grow && this.box ? union(this.box, fitted) : fitted;
    const [left, low, right, high] = this.box;
    const [across, up] = sizes(this.box).map((size) => Math.max(size, 0.2));
    this.scale = Math.min((this.width - 2 * MARGIN_PX) / across, (this.height - MARGIN_PX - FOOT_PX) / up);
    this.x0 = this.width / 2 - (this.scale * (left + right)) / 2;
    this.y0 = (this.height + MARGIN_PX - FOOT_PX) / 2 + (this.scale * (low + high)) / 2;
  }

  /** Sets the fitted area and discards pan and zoom. @param {string} mode */
  show(mode) {
    [this.mode, this.box, this.moved] = [mode, null, false];
  }

  /** Sets the size of the stage; a moved view keeps its centre. @param {number} width @param {number} height */
  resize(width, height) {
    if (this.moved) this.pan((width - this.width) / 2, (height - this.height) / 2);
    [this.width, this.height] = [width, height];
  }

  /** Zooms about a pixel. @param {number} factor @param {number[]} px */
  zoom(factor, [x, y]) {
    const scale = Math.max(MIN_SCALE, Math.min(MAX_SCALE, this.scale * factor));
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

  /** Converts a point from metres to pixels. @param {number[]} point @returns {[number, number]} */
  px([x, y]) {
    return [this.x0 + this.scale * x, this.y0 - this.scale * y];
  }

  /** Converts a pixel to a point, metres. @param {number[]} px @returns {[number, number]} */
  world([x, y]) {
    return [(x - this.x0) / this.scale, (this.y0 - y) / this.scale];
  }

  /** @param {number[]} px */
  isOutside([x, y]) {
    return x < 2 || y < 2 || x > this.width - 2 || y > this.height - 2;
  }

  /** Returns `true` if fitting a reading at a point would enlarge the view. */
  wouldGrow(point) {
    if (this.mode === "room" || this.moved || !this.box) return false;
    /** @type {(point: number[], box: number[]) => boolean} */
    const inside = ([x, y], [left, low, right, high]) => x >= left && y >= low && x <= right && y <= high;
    return this.isOutside(this.px(point)) && !inside(point, this.box);
  }

  /**
   * Point at which a ray from a pixel leaves the view; `turn` in radians clockwise from the right.
   * @param {number[]} px
   * @param {number} turn
   * @returns {[number, number]}
   */
  border([x, y], turn) {
    const inset = 3;
    const [dx, dy] = [Math.cos(turn), Math.sin(turn)];
    const distance = (at, along, size) =>
      along > 1e-9 ? (size - inset - at) / along : along < -1e-9 ? (inset - at) / along : Infinity;
    const length = Math.max(0, Math.min(distance(x, dx, this.width), distance(y, dy, this.height)));
    return [x + length * dx, y + length * dy];
  }
}

function boxOf(points) {
  if (!points.length) return null;
  const [xs, ys] = [0, 1].map((axis) => points.map((point) => point[axis]));
  const min = (values) => values.reduce((a, b) => Math.min(a, b));
  const max = (values) => values.reduce((a, b) => Math.max(a, b));
  return [min(xs), min(ys), max(xs), max(ys)];
}

/** @param {number[]} box */
const sizes = ([left, low, right, high]) => [right - left, high - low];

const union = (a, b) => (b ? a.map((value, i) => (i < 2 ? Math.min(value, b[i]) : Math.max(value, b[i]))) : a);

const clip = (box, limit) => box.map((value, i) => (i < 2 ? Math.max(value, limit[i]) : Math.min(value, limit[i])));
