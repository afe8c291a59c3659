// Pan and zoom of a view by wheel, drag, pinch and keys. Clicks that are no gesture are passed on.

/** Movement below which a press counts as a click, pixels. */
const CLICK_TOLERANCE_PX = 5;
/** Step of an arrow key, pixels; a tenth of it with shift. */
const STEP_PX = 60;
const KEY_FACTOR = 1.25;
const KEYS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const ZOOMS = { "+": KEY_FACTOR, "=": KEY_FACTOR, "-": 1 / KEY_FACTOR, _: 1 / KEY_FACTOR };

export class Gestures {
  /**
   * @param {HTMLElement} stage focusable element that receives keys
   * @param {HTMLElement} canvas element that receives pointer events
   * @param {import("./view.js").View} view
   * @param {{onMove: () => void, onClick: (px: number[]) => void, onHover: (px: number[]) => void,
   *   onLeave: () => void, onKey: (event: KeyboardEvent) => boolean}} callbacks
   */
  constructor(stage, canvas, view, callbacks) {
    this.stage = stage;
    this.canvas = canvas;
    this.view = view;
    this.callbacks = callbacks;
    /** Positions of the pressed pointers by id, pixels. @type {Map<number, number[]>} */
    this.pointers = new Map();
    this.from = [0, 0];
    this.dragging = false;
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerleave", () => callbacks.onLeave());
    canvas.addEventListener("pointerup", (event) => this.up(event));
    canvas.addEventListener("pointercancel", (event) => this.up(event));
    canvas.addEventListener("click", (event) => callbacks.onClick([event.offsetX, event.offsetY]));
    // A single finger scrolls the page unless the view was moved; two fingers always act on the plan.
    const own = (event) => (event.touches.length > 1 || view.moved) && event.cancelable && event.preventDefault();
    for (const kind of ["touchstart", "touchmove"]) canvas.addEventListener(kind, own, { passive: false });
    stage.addEventListener("keydown", (event) => this.key(event));
  }

  /** @param {WheelEvent} event */
  wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : 1;
    // A trackpad pinch arrives as wheel events with the control key set, in small steps.
    const by = -event.deltaY * lines * (event.ctrlKey ? 0.01 : 0.0015);
    this.view.zoom(Math.exp(Math.max(-0.7, Math.min(0.7, by))), [event.offsetX, event.offsetY]);
    this.callbacks.onMove();
  }

  /** @param {PointerEvent} event */
  down(event) {
    if (event.button > 1) return;
    this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    if (this.pointers.size === 1) [this.from, this.dragging] = [[event.offsetX, event.offsetY], false];
  }

  /** @param {PointerEvent} event */
  move(event) {
    const now = [event.offsetX, event.offsetY];
    const previous = this.pointers.get(event.pointerId);
    if (!previous) return this.callbacks.onHover(now);
    if (!this.dragging && !this.startDrag(event, now)) return;
    if (this.pointers.size === 2) this.pinch(event.pointerId, previous, now);
    else this.view.pan(now[0] - previous[0], now[1] - previous[1]);
    this.pointers.set(event.pointerId, now);
    this.callbacks.onMove();
  }

  /** Starts a drag and returns `true`, unless the pointer is still within the click tolerance or a single finger on a fitted view. */
  startDrag(event, now) {
    const single = this.pointers.size === 1;
    if (single && event.pointerType === "touch" && !this.view.moved) return false;
    if (single && Math.hypot(now[0] - this.from[0], now[1] - this.from[1]) < CLICK_TOLERANCE_PX) return false;
    this.dragging = true;
    this.canvas.classList.add("dragged");
    for (const id of this.pointers.keys()) this.canvas.setPointerCapture(id);
    return true;
  }

  /** Zooms about the midpoint of two fingers and pans with it. */
  pinch(id, previous, now) {
    const other = [...this.pointers].find(([pointer]) => pointer !== id)[1];
    const separation = (at) => Math.max(1, Math.hypot(at[0] - other[0], at[1] - other[1]));
    this.view.zoom(separation(now) / separation(previous), other.map((at, i) => (at + previous[i]) / 2));
    this.view.pan((now[0] - previous[0]) / 2, (now[1] - previous[1]) / 2);
  }

  /** @param {PointerEvent} event */
  up(event) {
    if (!this.pointers.delete(event.pointerId) || this.pointers.size > 0 || !this.dragging) return;
    this.dragging = false;
    this.canvas.classList.remove("dragged");
    // Suppresses the click event that follows a drag.
    const swallow = (click) => click.stopPropagation();
    addEventListener("click", swallow, { capture: true, once: true });
    setTimeout(() => removeEventListener("click", swallow, { capture: true }));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.target !== this.stage || event.ctrlKey || event.metaKey || event.altKey) return;
    const by = event.shiftKey ? STEP_PX / 10 : STEP_PX;
    const [along, factor] = [KEYS[event.key], ZOOMS[event.key]];
    if (this.callbacks.onKey(event)) event.preventDefault();
    else if (along || factor) {
      event.preventDefault();
      if (along) this.view.pan(by * along[0], by * along[1]);
      else this.view.zoom(factor, [this.view.width / 2, this.view.height / 2]);
      this.callbacks.onMove();
    }
  }
}
