// Wheel, drag, pinch and keys: they move and zoom a view. A click that was none of these is handed on.

/** A pointer that moved less than this was meant as a click, pixels. */
const STILL_PX = 5;
/** What an arrow key moves by, pixels; with shift a tenth of it. */
const STEP_PX = 60;
const KEY_FACTOR = 1.25;
const KEYS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const ZOOMS = { "+": KEY_FACTOR, "=": KEY_FACTOR, "-": 1 / KEY_FACTOR, _: 1 / KEY_FACTOR };

export class Gestures {
  /**
   * @param {HTMLElement} stage which has the focus for keys
   * @param {HTMLElement} canvas which the pointers are on
   * @param {import("./view.js").View} view
   * @param {{onMove: () => void, onClick: (px: number[]) => void, onHover: (px: number[]) => void,
   *   onKey: (event: KeyboardEvent) => boolean}} uses
   */
  constructor(stage, canvas, view, uses) {
    this.stage = stage;
    this.canvas = canvas;
    this.view = view;
    this.uses = uses;
    /** Where each pointer is that is down, pixels. @type {Map<number, number[]>} */
    this.pointers = new Map();
    this.from = [0, 0];
    this.dragging = false;
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => this.up(event));
    canvas.addEventListener("pointercancel", (event) => this.up(event));
    canvas.addEventListener("click", (event) => uses.onClick([event.offsetX, event.offsetY]));
    // One finger scrolls the page, unless the view was moved; two are the plan's.
    const own = (event) => (event.touches.length > 1 || view.moved) && event.cancelable && event.preventDefault();
    for (const kind of ["touchstart", "touchmove"]) canvas.addEventListener(kind, own, { passive: false });
    stage.addEventListener("keydown", (event) => this.key(event));
  }

  /** @param {WheelEvent} event */
  wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : 1;
    // A pinch on a pad comes as a wheel with control, in small steps.
    const by = -event.deltaY * lines * (event.ctrlKey ? 0.01 : 0.0015);
    this.view.zoom(Math.exp(Math.max(-0.7, Math.min(0.7, by))), [event.offsetX, event.offsetY]);
    this.uses.onMove();
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
    const before = this.pointers.get(event.pointerId);
    if (!before) return this.uses.onHover(now);
    if (!this.dragging && !this.begins(event, now)) return;
    if (this.pointers.size === 2) this.pinch(event.pointerId, before, now);
    else this.view.pan(now[0] - before[0], now[1] - before[1]);
    this.pointers.set(event.pointerId, now);
    this.uses.onMove();
  }

  /** Whether a pointer begins to move the view: a lone finger only where the view was moved before. */
  begins(event, now) {
    const alone = this.pointers.size === 1;
    if (alone && event.pointerType === "touch" && !this.view.moved) return false;
    if (alone && Math.hypot(now[0] - this.from[0], now[1] - this.from[1]) < STILL_PX) return false;
    this.dragging = true;
    this.canvas.classList.add("held");
    for (const id of this.pointers.keys()) this.canvas.setPointerCapture(id);
    return true;
  }

  /** What is between two fingers stays between them. */
  pinch(id, before, now) {
    const other = [...this.pointers].find(([one]) => one !== id)[1];
    const apart = (at) => Math.max(1, Math.hypot(at[0] - other[0], at[1] - other[1]));
    this.view.zoom(apart(now) / apart(before), other.map((at, i) => (at + before[i]) / 2));
    this.view.pan((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
  }

  /** @param {PointerEvent} event */
  up(event) {
    if (!this.pointers.delete(event.pointerId) || this.pointers.size > 0 || !this.dragging) return;
    this.dragging = false;
    this.canvas.classList.remove("held");
    // The click that ends a drag is none.
    const swallow = (click) => click.stopPropagation();
    addEventListener("click", swallow, { capture: true, once: true });
    setTimeout(() => removeEventListener("click", swallow, { capture: true }));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.target !== this.stage || event.ctrlKey || event.metaKey || event.altKey) return;
    const by = event.shiftKey ? STEP_PX / 10 : STEP_PX;
    const [along, factor] = [KEYS[event.key], ZOOMS[event.key]];
    if (this.uses.onKey(event)) event.preventDefault();
    else if (along || factor) {
      event.preventDefault();
      if (along) this.view.pan(by * along[0], by * along[1]);
      else this.view.zoom(factor, [this.view.width / 2, this.view.height / 2]);
      this.uses.onMove();
    }
  }
}
