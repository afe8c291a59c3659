// Handles on the floor plan: buttons that are dragged with mouse or finger, or moved with the arrow keys.

/** What an arrow key moves by, metres; with shift ten times as much. */
const STEP_M = 0.01;
const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/** @typedef {[number, number]} Point */

export class Handle {
  /**
   * @param {HTMLElement} stage
   * @param {{name: string, className: string, onMove: (at: Point, handle: Handle) => void, onDone?: () => void,
   *   onKey?: (key: string, shift: boolean) => boolean, onFocus?: () => void}} uses
   * @param {{px: (at: Point) => Point, world: (px: Point) => Point}} view
   */
  constructor(stage, uses, view) {
    this.uses = uses;
    this.view = view;
    this.stage = stage;
    /** @type {Point} */
    this.at = [0, 0];
    this.button = document.createElement("button");
    this.button.type = "button";
    this.button.className = `handle ${uses.className}`;
    this.button.ariaLabel = uses.name;
    stage.append(this.button);
    this.button.addEventListener("pointerdown", (event) => this.grab(event));
    this.button.addEventListener("keydown", (event) => this.key(event));
    if (uses.onFocus) this.button.addEventListener("focus", uses.onFocus);
  }

  /**
   * @param {Point} at metres
   * @param {string} [name]
   */
  place(at, name) {
    this.at = at;
    const [x, y] = this.view.px(at);
    const [width, height] = [this.stage.clientWidth, this.stage.clientHeight];
    // What is beyond the view can be fetched from its border.
    const within = (/** @type {number} */ value, /** @type {number} */ most) => Math.max(0, Math.min(most, value));
    this.button.style.transform = `translate(${within(x, width)}px, ${within(y, height)}px)`;
    if (name && this.button.ariaLabel !== name) this.button.ariaLabel = name;
  }

  /** @param {PointerEvent} event */
  grab(event) {
    if (event.button !== 0) return;
    this.button.setPointerCapture(event.pointerId);
    const [x, y] = this.view.px(this.at);
    const [dx, dy] = [event.clientX - x, event.clientY - y];
    const move = (/** @type {PointerEvent} */ moved) => {
      this.uses.onMove(this.view.world([moved.clientX - dx, moved.clientY - dy]), this);
    };
    const end = () => {
      this.button.removeEventListener("pointermove", move);
      this.button.classList.remove("held");
      this.uses.onDone?.();
    };
    this.button.classList.add("held");
    this.button.addEventListener("pointermove", move);
    this.button.addEventListener("lostpointercapture", end, { once: true });
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (this.uses.onKey?.(event.key, event.shiftKey)) return event.preventDefault();
    const along = KEYS[/** @type {keyof typeof KEYS} */ (event.key)];
    if (!along) return;
    event.preventDefault();
    const step = STEP_M * (event.shiftKey ? 10 : 1);
    this.uses.onMove([this.at[0] + step * along[0], this.at[1] + step * along[1]], this);
    this.uses.onDone?.();
  }

  remove() {
    this.button.remove();
  }
}
