// Steps of the guided tour: the view of each step and its text. The browser tests check every claim.

/**
 * @typedef {{title: string, text: string, scene: string, pose: import("./engine.js").Pose, beam: number,
 *   range_m: number, arcs?: boolean, compare?: boolean, fit?: string}} Step
 */

/** Steps in order. Azimuths are 0.9 degrees apart; all walls of these scenes are smooth. @type {Step[]} */
export const STEPS = [
  {
    title: "A room as the sensor measures it",
    text:
      "Lines are the walls; each mark is the range measured in that direction. Only walls that face the sensor are " +
      "measured at their true distance. Drag the ranger, turn it with the small handle, and watch the readings. Click " +
      "a mark to see its propagation path.",
    scene: "two-surface-room",
    pose: { x_m: 1.2, y_m: 1.0, heading_deg: 0 },
    beam: 200,
    range_m: 5,
  },
  {
    title: "The false wall",
    text:
      "The wall below is 85 mm away, but the measured range is 0.83 m. While transmitting, the receiver is blanked: the " +
      "wall's own echo ends before the blanking does. The detected echo was reflected three times: by the near wall, the " +
      "far wall, and the near wall again. Play the pulse to see it travel; then move the ranger up until the near wall is " +
      "detected directly.",
    scene: "simple-room",
    pose: { x_m: 0.774, y_m: 0.085, heading_deg: 0 },
    beam: 300,
    range_m: 3,
    fit: "near",
  },
  {
    title: "Walls and corners are arcs",
    text:
      "Two walls and the corner between them appear as three arcs of about 20 degrees. The beam is wide: while it sweeps " +
      "across a wall, the echo from the foot of the perpendicular remains the first, at constant range. A right-angled " +
      "corner is a retroreflector and looks just like another wall.",
    scene: "right-angle-corner",
    pose: { x_m: 0, y_m: 0, heading_deg: 0 },
    beam: 244,
    range_m: 3,
    arcs: true,
  },
  {
    title: "Walls that vanish",
    text:
      "Between the arcs there is wall, but no echo. At a wavelength of 7 mm a smooth wall is a mirror: beyond about ten " +
      "degrees off the perpendicular the reflection misses the sensor. Give the walls a roughness of 0.3 and some of the " +
      "sound is scattered back.",
    scene: "right-angle-corner",
    pose: { x_m: 0, y_m: 0, heading_deg: 0 },
    beam: 161,
    range_m: 3,
  },
  {
    title: "Edges",
    text:
      "Sound is diffracted at the end of a wall, and a little of it returns from the edge. At the edge of the southern " +
      "wall it exceeds the threshold in just one beam. Lower the threshold by 10 dB, and more beams detect it.",
    scene: "right-angle-corner",
    pose: { x_m: 0, y_m: 0, heading_deg: 0 },
    beam: 352,
    range_m: 3,
  },
  {
    title: "Minimum range",
    text:
      "The eastern wall is 94 mm away. When the blanking ends, at 0.41 m, sound is still bouncing between the wall and the " +
      "transducer. The sensor detects it at once and reports its minimum range. Move the ranger away from the wall until " +
      "the echoes are separate.",
    scene: "simple-room",
    pose: { x_m: 0.834, y_m: 0.345, heading_deg: 0 },
    beam: 0,
    range_m: 3,
  },
  {
    title: "What simpler models miss",
    text:
      "The same pose in three models, below the plan. A cone, as in most simulators, reports the nearest object within the " +
      "beam: it never predicts false walls or missing echoes. A fan of rays includes reflections, but treats each echo separately. The " +
      "exact paths, summed in the receiver, predict what the sensor reports. Now draw a room of your own with Edit room, or " +
      "open a log and drag the ranger to where it was measured.",
    scene: "simple-room",
    pose: { x_m: 0.774, y_m: 0.085, heading_deg: 0 },
    beam: 300,
    range_m: 3,
    compare: true,
  },
];
