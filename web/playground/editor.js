// Room editor: corners and pillars are handles on the plan; walls are added by clicks.

import { Handle } from "../../crates/sonard-daemon/src/server/page/drag-handles.js";
import { addPillar, addWall, cornersOf, newRoom, moveCorner, removeCorner } from "./room.js";
import { rounded } from "../../crates/sonard-daemon/src/server/page/ranger.js";

/** @param {string} id */
const byId = (id) => /** @type {HTMLButtonElement} */ (document.getElementById(id));

/** Snap distance to corners, pixels. */
const SNAP_PX = 14;

/** @typedef {import("./room.js").Point} Point */

export class Editor {
  /**
   * @param {HTMLElement} stage
   * @param {any} view of the plan
   * @param {(scene: import("./room.js").SceneFile, final: boolean, pose?: import("./engine.js").Pose) => void} onScene
   */
  constructor(stage, view, onScene) {
    this.stage = stage;
    this.view = view;
    this.onScene = onScene;
    this.open = false;
    /** @type {import("./room.js").SceneFile} */
    this.scene = newRoom();
    /** @type {Handle[]} */
    this.handles = [];
    /** Start of the next wall. @type {Point | null} */
    this.from = null;
    this.adding = false;
    /** Scene at the start of a drag. Edits start from it, so that a corner dragged across another is not joined with it. */
    this.dragStart = /** @type {import("./room.js").SceneFile | null} */ (null);
    byId("edit").addEventListener("click", () => this.toggle(!this.open));
    byId("add-wall").addEventListener("click", () => this.add(!this.adding));
    byId("add-pillar").addEventListener("click", () => this.change((scene) => addPillar(scene, this.middle())));
    byId("new-room").addEventListener("click", () => {
      const room = newRoom();
      this.onScene(room, true, room.poses?.start);
      this.view.show(this.view.mode);
    });
    stage.addEventListener("click", (event) => this.click(event), { capture: true });
    stage.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.add(false);
    });
  }

  /** @param {boolean} open */
  toggle(open) {
    this.open = open;
    byId("edit").ariaPressed = String(open);
    byId("drawing").hidden = !open;
    this.add(false);
    this.show(this.scene);
  }

  /** @param {boolean} adding */
  add(adding) {
    [this.adding, this.from] = [adding, null];
    byId("add-wall").ariaPressed = String(adding);
    this.stage.classList.toggle("adding", adding);
  }

  /** Places handles at corners and pillars. @param {import("./room.js").SceneFile} scene */
  show(scene) {
    this.scene = scene;
    if (this.dragStart) return;
    const items = this.open ? this.items() : [];
    while (this.handles.length > items.length) this.handles.pop()?.remove();
    items.forEach((item, i) => {
      const handle = (this.handles[i] ??= this.handle(i));
      handle.button.classList.toggle("corner", !item.pillar);
      handle.button.classList.toggle("pillar", item.pillar);
      handle.place(item.at, `${item.pillar ? "Pillar" : "Corner"} at (${item.at.map((m) => m.toFixed(2)).join(", ")}) m`);
    });
  }

  /** Corners, then pillars. */
  items() {
    const corners = cornersOf(this.scene).map((corner) => ({ at: corner.at, pillar: false, corner }));
    const pillars = (this.scene.cylinders ?? []).map((cylinder) => ({ at: cylinder.center, pillar: true, cylinder }));
    return [...corners, ...pillars];
  }

  /** @param {number} index of the item */
  handle(index) {
    return new Handle(
      this.stage,
      {
        name: "Corner",
        className: "",
        onMove: (at, handle) => {
          this.dragStart ??= this.scene;
          handle.place(at);
          this.move(this.dragStart, index, at);
        },
        onDone: () => {
          this.dragStart = null;
          this.onScene(this.scene, true);
        },
        onKey: (key) => {
          if (key === "Escape") this.add(false);
          if (key !== "Delete" && key !== "Backspace") return false;
          this.remove(index);
          return true;
        },
      },
      this.view,
    );
  }

  /**
   * @param {import("./room.js").SceneFile} start
   * @param {number} index
   * @param {Point} at
   */
  move(start, index, at) {
    const scene = structuredClone(start);
    const corners = cornersOf(scene);
    if (index < corners.length) moveCorner(corners[index], at);
    else {
      const cylinder = scene.cylinders?.[index - corners.length];
      if (cylinder) cylinder.center = [rounded(at[0], 2), rounded(at[1], 2)];
    }
    this.onScene(scene, false);
  }

  /** @param {number} index */
  remove(index) {
    this.change((scene) => {
      const corners = cornersOf(scene);
      if (index < corners.length) removeCorner(scene, corners[index]);
      else scene.cylinders?.splice(index - corners.length, 1);
    });
    (this.handles[index] ?? this.handles.at(-1))?.button.focus();
  }

  /** Starts or ends a wall at a click. @param {MouseEvent} event */
  click(event) {
    if (!this.adding) return;
    const box = this.stage.getBoundingClientRect();
    const at = this.snap([event.clientX - box.left, event.clientY - box.top]);
    event.stopPropagation();
    event.preventDefault();
    const from = this.from;
    this.from = at;
    if (from && Math.hypot(at[0] - from[0], at[1] - from[1]) > 0.005) this.change((scene) => addWall(scene, from, at));
  }

  /** @param {Point} px @returns {Point} */
  snap(px) {
    for (const { at } of cornersOf(this.scene)) {
      const [x, y] = this.view.px(at);
      if (Math.hypot(x - px[0], y - px[1]) < SNAP_PX) return [at[0], at[1]];
    }
    const [x, y] = this.view.world(px);
    return [rounded(x, 2), rounded(y, 2)];
  }

  /** @param {(scene: import("./room.js").SceneFile) => void} edit */
  change(edit) {
    const scene = structuredClone(this.scene);
    edit(scene);
    this.onScene(scene, true);
  }

  /** @returns {Point} */
  middle() {
    return this.view.world([this.view.width / 2, this.view.height / 2]);
  }
}
