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
  beyond: { words: "reading beyond the view", colour: "--ink", width: 1, sign: "arrow" },
};

/** Names in the order of the legend. */
export const PEN_NAMES = Object.keys(PENS);
export const penWords = (name) => PENS[name].words;

/** A canvas, and what has been drawn on it since it was cleared. */
export class Layer {
  constructor(canvas) {
    this.canvas = canvas;
    this.c = canvas.getContext("2d");
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

  clear() {
    this.used.clear();
    this.c.clearRect(0, 0, this.width, this.height);
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

/** @param {CanvasRenderingContext2D} c @param {number[]} at @param {number} radius */
export function circle(c, [x, y], radius) {
  c.beginPath();
  c.arc(x, y, radius, 0, 2 * Math.PI);
  c.stroke();
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
    default:
      return line(c, [[1, 8], [23, 8]]);
  }
}
