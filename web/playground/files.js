// Files: rooms, logs and tables of readings can be opened or dropped; rooms can be saved.

import { textOf } from "./room.js";

/** Maximum file size, bytes: several copies must fit into memory. */
const MAX_BYTES = 50 << 20;

/** @param {string} id */
const byId = (id) => /** @type {any} */ (document.getElementById(id));

export class Files {
  /**
   * @param {{room: (scene: import("./room.js").SceneFile) => void, log: (text: string) => void,
   *   onError: (problem: import("./engine.js").Problem) => void}} callbacks
   */
  constructor(callbacks) {
    this.callbacks = callbacks;
    byId("load").addEventListener("click", () => byId("file").click());
    byId("file").addEventListener("change", () => {
      const [file] = byId("file").files;
      if (file) this.open(file);
      byId("file").value = "";
    });
    addEventListener("dragover", (event) => {
      event.preventDefault();
      byId("drop").hidden = false;
    });
    addEventListener("dragleave", (event) => {
      if (event.relatedTarget === null) byId("drop").hidden = true;
    });
    addEventListener("drop", (event) => {
      event.preventDefault();
      byId("drop").hidden = true;
      const file = event.dataTransfer?.files[0];
      if (file) this.open(file);
    });
  }

  /** @param {File} file */
  async open(file) {
    if (file.size > MAX_BYTES) {
      const message = `${file.name} is larger than ${MAX_BYTES >> 20} MB`;
      return this.callbacks.onError({ message, help: "use `sonard compare`, which reads logs of any length" });
    }
    const text = await file.text();
    const scene = sceneIn(text);
    if (scene) this.callbacks.room(scene);
    else this.callbacks.log(text);
  }

  /** @param {import("./room.js").SceneFile} scene */
  save(scene) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([textOf(scene)], { type: "application/json" }));
    link.download = `${scene.name}.json`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }
}

/** Returns the scene if the text is a JSON object with materials, else `null`. @param {string} text */
function sceneIn(text) {
  try {
    const value = JSON.parse(text);
    return typeof value === "object" && value !== null && value.materials ? value : null;
  } catch {
    return null;
  }
}
