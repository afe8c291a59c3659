// Handles on the floor plan: buttons moved by mouse, finger or arrow keys.

/** Step of an arrow key, metres; ten times as much with shift. */
const STEP_M = 0.01;
const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/** @typedef {[number, number]} Point */

export class Handle {
  /**
   * @param {HTMLElement} stage
   * @param {{name: string, className: string, onMove: (at: Point, handle: Handle) => void, onDone?: () => void,
   *   onKey?: (key: string, shift: boolean) => boolean, onFocus?: () => void}} options
   * @param {{px: (at: Point) => Point, world: (px: Point) => Point}} view
   */
  constructor(stage, options, view) {
    this.options = options;
    this.view = view;
    this.stage = stage;
    /** @type {Point} */
    this.at = [0, 0];
    this.button = document.createElement("button");
    this.button.type = "button";
    this.button.className = `handle ${options.className}`;
    this.button.ariaLabel = options.name;
    stage.append(this.button);
    this.button.addEventListener("pointerdown", (event) => this.grab(event));
    this.button.addEventListener("keydown", (event) => this.key(event));
    if (options.onFocus) this.button.addEventListener("focus", options.onFocus);
  }

  /**
   * @param {Point} at metres
   * @param {string} [name]
   */
  place(at, name) {
    this.at = at;
    const [x, y] = this.view.px(at);
    const [width, height] = [this.stage.clientWidth, this.stage.clientHeight];
    // Handles outside the view stay reachable at its edge.
    const clamp = (/** @type {number} */ value, /** @type {number} */ max) => Math.max(0, Math.min(max, value));
    this.button.style.transform = `translate(${clamp(x, width)}px, ${clamp(y, height)}px)`;
    if (name && this.button.ariaLabel !== name) this.button.ariaLabel = name;
  }

  /** @param {PointerEvent} event */
  grab(event) {
    if (event.button !== 0) return;
    this.button.setPointerCapture(event.pointerId);
    const [x, y] = this.view.px(this.at);
    const [dx, dy] = [event.clientX - x, event.clientY - y];
    const move = (/** @type {PointerEvent} */ moved) => {
      this.options.onMove(this.view.world([moved.clientX - dx, moved.clientY - dy]), this);
    };
    const end = () => {
      this.button.removeEventListener("pointermove", move);
      this.button.classList.remove("dragged");
      this.options.onDone?.();
    };
    this.button.classList.add("dragged");
    this.button.addEventListener("pointermove", move);
    this.button.addEventListener("lostpointercapture", end, { once: true });
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (this.options.onKey?.(event.key, event.shiftKey)) return event.preventDefault();
    const along = KEYS[/** @type {keyof typeof KEYS} */ (event.key)];
    if (!along) return;
    event.preventDefault();
    const step = STEP_M * (event.shiftKey ? 10 : 1);
    this.options.onMove([this.at[0] + step * along[0], this.at[1] + step * along[1]], this);
    this.options.onDone?.();
  }

  remove() {
    this.button.remove();
  }
}
