// Geometry of a reading's `viewpoint`: position and direction of the transducer at the time of the ping.

const RAD_PER_DEG = Math.PI / 180;

/** Point at a range along the beam, metres; `turn_deg` turns the direction counterclockwise. @returns {[number, number]} */
export function pointAt({ x_m, y_m, direction_deg }, range_m, turn_deg = 0) {
  const direction = (direction_deg + turn_deg) * RAD_PER_DEG;
  return [x_m + range_m * Math.cos(direction), y_m + range_m * Math.sin(direction)];
}

/** Angle between the beam axis and the direction to a point, degrees from 0 to 180. */
export function angleOffAxis({ x_m, y_m, direction_deg }, [x, y]) {
  const angle_deg = Math.atan2(y - y_m, x - x_m) / RAD_PER_DEG - direction_deg;
  return Math.abs((((angle_deg % 360) + 540) % 360) - 180);
}

/** Transforms a point from the robot frame (forward, left) to world coordinates, metres. @returns {[number, number]} */
export function robotToWorld({ x_m, y_m, heading_deg }, [ahead, left]) {
  const [cos, sin] = [Math.cos(heading_deg * RAD_PER_DEG), Math.sin(heading_deg * RAD_PER_DEG)];
  return [x_m + cos * ahead - sin * left, y_m + sin * ahead + cos * left];
}
