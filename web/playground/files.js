// Rooms, logs and tables of readings as files: opened, dropped, saved.

import { textOf } from "./room.js";

/** A longer file would not fit into memory several times over, bytes. */
const MOST_BYTES = 50 << 20;

/** @param {string} id */
const byId = (id) => /** @type {any} */ (document.getElementById(id));

export class Files {
  /**
   * @param {{room: (scene: import("./room.js").SceneFile) => void, log: (text: string) => void,
   *   refused: (problem: import("./engine.js").Problem) => void}} uses
   */
  constructor(uses) {
    this.uses = uses;
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
    if (file.size > MOST_BYTES) {
      const message = `${file.name} is longer than ${MOST_BYTES >> 20} MB`;
      return this.uses.refused({ message, help: "`sonard compare` takes logs of any length" });
    }
    const text = await file.text();
    const scene = sceneIn(text);
    if (scene) this.uses.room(scene);
    else this.uses.log(text);
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

/** A scene, if the text is one object with materials. @param {string} text */
function sceneIn(text) {
  try {
    const value = JSON.parse(text);
    return typeof value === "object" && value !== null && value.materials ? value : null;
  } catch {
    return null;
  }
}
