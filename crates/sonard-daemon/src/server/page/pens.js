// Lines and signs of the floor plan, each with its words in the legend. What is drawn with a pen is
// noted for its layer, so that the legend has everything that is drawn and nothing else.

/** Colours are the style's names; widths and dashes are pixels. */
const PENS = {
  wall: { words: "wall", colour: "--wall", width: 2 },
  rough: { words: "rough wall", colour: "--wall", width: 2, dash: [4, 4] },
  robot: { words: "robot", colour: "--edge", width: 1.5 },
  pose: { words: "pose and heading", colour: "--ink", width: 1.5, sign: "pose" },
  face: { words: "transducer", colour: "--ink", width: 2, sign: "face" },
  blanking: { words: "nearest range that is heard", colour: "--min-range", width: 1, sign: "arc" },
  newest: { words: "direction of the newest reading", colour: "--quiet", width: 1.2, dash: [2, 5] },
  direction: { words: "direction of the selected beam", colour: "--ray", width: 1.2, dash: [6, 4] },
  selected: { words: "selected reading", colour: "--ray", width: 2, sign: "ring" },
  path: { words: "path of its sound", colour: "--path", width: 1.8, sign: "leg" },
  fan: { words: "arc of a reading: within the beam, so far away", colour: "--quiet", width: 1.2, sign: "arc" },
  before: { words: "reading of the sweep before", colour: "--silent", width: 1, sign: "dot" },
  measure: { words: "measured length", colour: "--good", width: 1.6, sign: "length" },
  second: { words: "reading of the pinned scan", colour: "--wait", width: 1.2, sign: "dot" },
  average: { words: "average of both scans", colour: "--good", width: 1.2, sign: "dot" },
  difference: { words: "from the pinned scan to this one", colour: "--bad", width: 1.6 },
  occupied: { words: "map: occupied", colour: "--ink", width: 1, sign: "cell" },
  free: { words: "map: free", colour: "--direct", width: 1, sign: "cell" },
  found: { words: "fitted line", colour: "--good", width: 3 },
  feature: { words: "plane (P), corner (C), edge (E), unresolved (?)", colour: "--min-range", width: 1.5, sign: "ring" },
  preview: { words: "what the model expects of the next scan", colour: "--good", width: 1.3, sign: "square" },
  better: { words: "where it would be by the chosen explanation", colour: "--bad", width: 2, dash: [7, 3] },
  beyond: { words: "reading beyond the view", colour: "--ink", width: 1, sign: "arrow" },
};

/** Names in the order of the legend. */
export const PEN_NAMES = Object.keys(PENS);
export const penWords = (name) => PENS[name].words;

/** A canvas, or a picture in the making, and what has been drawn on it since it was cleared. */
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

  /** What is drawn from now on is drawn in this view. @param {any} view */
  clear(view) {
    this.used.clear();
    this.c.clearRect(0, 0, this.width, this.height);
    this.drawnIn = { scale: view.scale, x0: view.x0, y0: view.y0 };
    if (this.canvas?.style.transform) this.canvas.style.transform = "";
  }

  /** Moves what is drawn to where it is in the view now, until it is drawn anew. @param {any} view */
  shift({ scale, x0, y0 }) {
    const by = scale / this.drawnIn.scale;
    const [dx, dy] = [x0 - by * this.drawnIn.x0, y0 - by * this.drawnIn.y0];
    this.canvas.style.transform = `matrix(${by}, 0, 0, ${by}, ${dx}, ${dy})`;
  }

  /** The context, set to draw with a pen. */
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

/** An upright line of a plot. @param {CanvasRenderingContext2D} c @param {number} x @param {number[]} between @param {string} colour */
export function upright(c, x, [top, bottom], colour) {
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

/** A line with a stroke across each end. @param {CanvasRenderingContext2D} c @param {number[]} from @param {number[]} to */
export function drawLength(c, from, to) {
  const turn = Math.atan2(to[1] - from[1], to[0] - from[0]);
  line(c, [from, to]);
  for (const end of [from, to]) drawFace(c, end, turn, 5);
}

/**
 * A filled triangle with its tip `tip` pixels ahead of a point, `turn` radians clockwise from the right.
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

/** Where a robot stands and where it heads. @param {CanvasRenderingContext2D} c @param {number[]} at @param {number} turn */
export function drawPose(c, [x, y], turn) {
  circle(c, [x, y], 4);
  line(c, [[x, y], [x + 15 * Math.cos(turn), y + 15 * Math.sin(turn)]]);
}

/**
 * A transducer's face, across its direction, `half` pixels to each side.
 * @param {CanvasRenderingContext2D} c
 * @param {number[]} at
 * @param {number} turn
 * @param {number} half
 */
export function drawFace(c, [x, y], turn, half) {
  const [dx, dy] = [half * Math.sin(turn), -half * Math.cos(turn)];
  line(c, [[x - dx, y - dy], [x + dx, y + dy]]);
}

/** A pen as the legend shows it, in a field of 24 by 16 pixels. */
export function drawSample(c, name, palette) {
  setPen(c, name, palette);
  switch (PENS[name].sign) {
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
