// Canvas layers of the floor plan, and the pens to draw on them. Each layer records the pens used since it was
// cleared, so that the legend lists exactly what is drawn.

/** Pens by name: legend label, colour (custom property of the style sheet), width and dash in pixels, legend symbol. */
const PENS = {
  wall: { label: "wall", colour: "--wall", width: 2 },
  rough: { label: "rough wall", colour: "--wall", width: 2, dash: [4, 4] },
  robot: { label: "robot", colour: "--border", width: 1.5 },
  pose: { label: "pose and heading", colour: "--ink", width: 1.5, symbol: "pose" },
  transducer: { label: "transducer", colour: "--ink", width: 2, symbol: "face" },
  blanking: { label: "minimum range (blanking)", colour: "--min-range", width: 1, symbol: "arc" },
  newest: { label: "current beam", colour: "--muted", width: 1.2, dash: [2, 5] },
  direction: { label: "direction of the selected beam", colour: "--ray", width: 1.2, dash: [6, 4] },
  selected: { label: "selected reading", colour: "--ray", width: 2, symbol: "ring" },
  path: { label: "propagation path", colour: "--path", width: 1.8, symbol: "leg" },
  arc: { label: "arc: possible positions of the reflector", colour: "--muted", width: 1.2, symbol: "arc" },
  previous: { label: "previous scan", colour: "--no-echo", width: 1, symbol: "dot" },
  measure: { label: "measured length", colour: "--good", width: 1.6, symbol: "length" },
  pinned: { label: "pinned scan", colour: "--wait", width: 1.2, symbol: "dot" },
  average: { label: "average of both scans", colour: "--good", width: 1.2, symbol: "dot" },
  difference: { label: "shift since the pinned scan", colour: "--bad", width: 1.6 },
  occupied: { label: "map: occupied", colour: "--ink", width: 1, symbol: "cell" },
  free: { label: "map: free", colour: "--direct", width: 1, symbol: "cell" },
  found: { label: "fitted line", colour: "--good", width: 3 },
  unconfirmed: { label: "fitted line without a wall of the scene", colour: "--bad", width: 2, dash: [6, 3] },
  feature: { label: "plane (P), corner (C), edge (E), unresolved (?)", colour: "--min-range", width: 1.5, symbol: "ring" },
  contradicted: { label: "contradicts the prediction (!)", colour: "--bad", width: 2, symbol: "ring" },
  observed: { label: "surveyed wall or post: observed", colour: "--good", width: 3.2 },
  implied: { label: "surveyed wall: implied", colour: "--good", width: 2.4, dash: [9, 3] },
  conjectured: { label: "surveyed wall or post: conjectured", colour: "--good", width: 2, dash: [1.5, 3] },
  surveyed: { label: "surveyed pose", colour: "--good", width: 1.5, symbol: "pose" },
  region: { label: "95 % region of the pose, enlarged", colour: "--good", width: 1, symbol: "ring" },
  truth: { label: "true wall or post", colour: "--border", width: 9 },
  odometry: { label: "pose by odometry", colour: "--muted", width: 1.5, symbol: "pose" },
  located: { label: "located pose", colour: "--bad", width: 2, dash: [2, 3] },
  lobe: { label: "main lobe up to the reading", colour: "--muted", width: 1, symbol: "lobe" },
  preview: { label: "preview of the next scan", colour: "--good", width: 1.3, symbol: "square" },
  hypothesis: { label: "position under the selected hypothesis", colour: "--bad", width: 2, dash: [7, 3] },
  front: { label: "wave front that is detected", colour: "--path", width: 2.5, symbol: "arc" },
  faint: { label: "wave front that is not detected", colour: "--muted", width: 1.5, symbol: "arc" },
  outside: { label: "outside the view", colour: "--ink", width: 1, symbol: "arrow" },
};

/** Pen names in the order of the legend. */
export const PEN_NAMES = Object.keys(PENS);
export const penLabel = (name) => PENS[name].label;

/** Drawing surface (canvas or picture export) with the set of pens used since it was cleared. */
export class Layer {
  /** @param {HTMLCanvasElement | null} canvas @param {any} c */
  constructor(canvas, c = canvas.getContext("2d")) {
    this.canvas = canvas;
    this.c = c;
    this.used = new Set();
    this.width = 0;
    this.height = 0;
  }

  resize(width, height) {
    const scale = devicePixelRatio;
    [this.width, this.height] = [width, height];
    this.canvas.width = Math.round(width * scale);
    this.canvas.height = Math.round(height * scale);
    this.c.setTransform(scale, 0, 0, scale, 0, 0);
  }

  /** Clears the layer and records the view of the drawing that follows. @param {any} view */
  clear(view) {
    this.used.clear();
    this.c.clearRect(0, 0, this.width, this.height);
    this.drawnView = { scale: view.scale, x0: view.x0, y0: view.y0 };
    if (this.canvas?.style.transform) this.canvas.style.transform = "";
  }

  /** Moves and scales the existing drawing to the current view with a CSS transform, until the next redraw. @param {any} view */
  shift({ scale, x0, y0 }) {
    const by = scale / this.drawnView.scale;
    const [dx, dy] = [x0 - by * this.drawnView.x0, y0 - by * this.drawnView.y0];
    this.canvas.style.transform = `matrix(${by}, 0, 0, ${by}, ${dx}, ${dy})`;
  }

  /** Selects a pen and returns the context. */
  pen(name, palette) {
    this.used.add(name);
    return setPen(this.c, name, palette);
  }
}

function setPen(c, name, palette) {
  const { colour, width, dash } = PENS[name];
  c.strokeStyle = c.fillStyle = palette[colour];
  c.lineWidth = width;
  c.lineCap = "butt";
  c.setLineDash(dash ?? []);
  return c;
}

export function line(c, points) {
  c.beginPath();
  points.forEach(([x, y], i) => (i ? c.lineTo(x, y) : c.moveTo(x, y)));
  c.stroke();
}

/** Vertical cursor line of a plot. @param {CanvasRenderingContext2D} c @param {number} x @param {number[]} between @param {string} colour */
export function drawVertical(c, x, [top, bottom], colour) {
  c.setLineDash([]);
  c.lineWidth = 1.4;
  c.strokeStyle = colour;
  line(c, [[x, top], [x, bottom]]);
}

/** @param {CanvasRenderingContext2D} c @param {number[]} at @param {number} radius */
export function circle(c, [x, y], radius) {
  c.beginPath();
  c.arc(x, y, radius, 0, 2 * Math.PI);
  c.stroke();
}

/** @param {CanvasRenderingContext2D} c @param {number[]} at @param {number} half */
export function square(c, [x, y], half) {
  line(c, [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half], [x - half, y - half]]);
}

/** @param {CanvasRenderingContext2D} c @param {number[]} at @param {number} radius */
export function disc(c, [x, y], radius) {
  c.beginPath();
  c.arc(x, y, radius, 0, 2 * Math.PI);
  c.fill();
}

/** Line with a perpendicular stroke at each end. @param {CanvasRenderingContext2D} c @param {number[]} from @param {number[]} to */
export function drawLength(c, from, to) {
  const turn = Math.atan2(to[1] - from[1], to[0] - from[0]);
  line(c, [from, to]);
  for (const end of [from, to]) drawFace(c, end, turn, 5);
}

/**
 * Filled triangle with its tip `tip` pixels ahead of a point; `turn` in radians clockwise from the right.
 * @param {CanvasRenderingContext2D} c
 * @param {number[]} at
 * @param {number} turn
 * @param {[tip: number, back: number, half: number]} size
 */
export function arrow(c, [x, y], turn, [tip, back, half]) {
  const [dx, dy] = [Math.cos(turn), Math.sin(turn)];
  c.beginPath();
  c.moveTo(x + tip * dx, y + tip * dy);
  c.lineTo(x - back * dx - half * dy, y - back * dy + half * dx);
  c.lineTo(x - back * dx + half * dy, y - back * dy - half * dx);
  c.fill();
}

/** Position circle with a heading line. @param {CanvasRenderingContext2D} c @param {number[]} at @param {number} turn */
export function drawPose(c, [x, y], turn) {
  circle(c, [x, y], 4);
  line(c, [[x, y], [x + 15 * Math.cos(turn), y + 15 * Math.sin(turn)]]);
}

/**
 * Transducer face, perpendicular to its direction; `half` is half its width in pixels.
 * @param {CanvasRenderingContext2D} c
 * @param {number[]} at
 * @param {number} turn
 * @param {number} half
 */
export function drawFace(c, [x, y], turn, half) {
  const [dx, dy] = [half * Math.sin(turn), -half * Math.cos(turn)];
  line(c, [[x - dx, y - dy], [x + dx, y + dy]]);
}

/** Sector of a circle around a direction. @param {any} c @param {number[]} at @param {number} turn @param {number} half radians @param {number} radius */
export function drawSector(c, [x, y], turn, half, radius) {
  c.beginPath();
  c.moveTo(x, y);
  c.lineTo(x + radius * Math.cos(turn - half), y + radius * Math.sin(turn - half));
  c.arc(x, y, radius, turn - half, turn + half);
  c.lineTo(x, y);
  c.stroke();
}

/** Draws a pen's legend symbol, 24 by 16 pixels. */
export function drawSample(c, name, palette) {
  setPen(c, name, palette);
  switch (PENS[name].symbol) {
    case "pose":
      return drawPose(c, [6, 8], 0);
    case "face":
      return drawFace(c, [12, 8], 0, 6);
    case "arc":
      c.beginPath();
      c.arc(12, 20, 14, 1.25 * Math.PI, 1.75 * Math.PI);
      return c.stroke();
    case "ring":
      return circle(c, [12, 8], 6);
    case "lobe":
      return drawSector(c, [2, 8], 0, 0.4, 20);
    case "leg":
      line(c, [[1, 8], [23, 8]]);
      return arrow(c, [12, 8], 0, [6, 4, 4]);
    case "arrow":
      return arrow(c, [12, 8], 0, [4, 5, 3]);
    case "dot":
      return disc(c, [12, 8], 3);
    case "cell":
      c.globalAlpha = 0.5;
      c.fillRect(6, 2, 12, 12);
      c.globalAlpha = 1;
      return;
    case "square":
      return square(c, [12, 8], 4);
    case "length":
      return drawLength(c, [3, 8], [21, 8]);
    default:
      return line(c, [[1, 8], [23, 8]]);
  }
}
