// A guided tour: what each step sets, and what it says. Its claims are tests.

/**
 * @typedef {{title: string, text: string, scene: string, pose: import("./engine.js").Pose, beam: number,
 *   range_m: number, arcs?: boolean, compare?: boolean, fit?: string}} Step
 */

/** Azimuths are 0.9 degrees apart; all walls of these scenes are smooth. @type {Step[]} */
export const STEPS = [
  {
    title: "A room, as a ranger hears it",
    text:
      "The walls are the lines; each mark is what the ranger reads in that direction. Only where a wall faces the " +
      "ranger is the reading the wall. Drag the ranger, turn it by its nose, and look at what changes. A click on a " +
      "mark shows the path of its sound.",
    scene: "two-surface-room",
    pose: { x_m: 1.2, y_m: 1.0, heading_deg: 0 },
    beam: 200,
    range_m: 5,
  },
  {
    title: "The false wall",
    text:
      "The wall below is 85 mm away, and the ranger reads 0.83 m. While it still transmits it is deaf: the wall's own " +
      "echo is over before it listens. What it hears went down, past the ranger to the far wall, and down again. Move " +
      "the ranger up until it hears the near wall itself.",
    scene: "simple-room",
    pose: { x_m: 0.774, y_m: 0.085, heading_deg: 0 },
    beam: 300,
    range_m: 3,
    fit: "near",
  },
  {
    title: "Walls and corners are arcs",
    text:
      "Two walls and a corner between them, and three arcs of some 20 degrees. The beam is wide: while it sweeps across " +
      "a wall, the echo from the foot of the perpendicular stays the first, at one and the same range. A corner sends " +
      "everything back where it came from, and looks just like another wall.",
    scene: "right-angle-corner",
    pose: { x_m: 0, y_m: 0, heading_deg: 0 },
    beam: 244,
    range_m: 3,
    arcs: true,
  },
  {
    title: "Walls that vanish",
    text:
      "Between the arcs there is wall, and the ranger hears nothing. To sound of 7 mm wavelength a smooth wall is a mirror: " +
      "beyond some ten degrees off the perpendicular the echo goes elsewhere. Give the walls a roughness of 0.3 and see " +
      "some of it come back.",
    scene: "right-angle-corner",
    pose: { x_m: 0, y_m: 0, heading_deg: 0 },
    beam: 161,
    range_m: 3,
  },
  {
    title: "Edges",
    text:
      "Where a wall ends, sound bends round it and a little of it comes back from the edge itself. Straight at the edge " +
      "of the southern wall it is just enough for one beam. Lower the threshold by 10 dB, and more beams hear it.",
    scene: "right-angle-corner",
    pose: { x_m: 0, y_m: 0, heading_deg: 0 },
    beam: 352,
    range_m: 3,
  },
  {
    title: "The nearest range",
    text:
      "The eastern wall is 94 mm away. When the ranger begins to listen, at 0.41 m, sound is still going to and fro " +
      "between the wall and its own face, and it reads that moment: the least it can ever say. Move it away from the " +
      "wall until the echoes come apart.",
    scene: "simple-room",
    pose: { x_m: 0.834, y_m: 0.345, heading_deg: 0 },
    beam: 0,
    range_m: 3,
  },
  {
    title: "What simpler models miss",
    text:
      "The same place by three models. A cone takes the nearest thing within the beam for the reading, as most " +
      "simulators do: it knows no false walls and no silence. A fan of rays knows reflections, but each sound by " +
      "itself. Only the exact paths, heard together by the receiver, are what such a ranger reads.",
    scene: "simple-room",
    pose: { x_m: 0.774, y_m: 0.085, heading_deg: 0 },
    beam: 300,
    range_m: 3,
    compare: true,
  },
];
