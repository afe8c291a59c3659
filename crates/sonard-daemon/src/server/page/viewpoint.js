// Where readings were taken: geometry of a reading's `viewpoint`, as the daemon tells it.

const TURN = Math.PI / 180;

/** The point at a range straight ahead, metres; `turn_deg` to the left of that. @returns {[number, number]} */
export function pointAt({ x_m, y_m, direction_deg }, range_m, turn_deg = 0) {
  const direction = (direction_deg + turn_deg) * TURN;
  return [x_m + range_m * Math.cos(direction), y_m + range_m * Math.sin(direction)];
}

/** How far a point lies off the direction of a viewpoint, degrees from 0 to 180. */
export function offDirection({ x_m, y_m, direction_deg }, [x, y]) {
  const off = Math.atan2(y - y_m, x - x_m) / TURN - direction_deg;
  return Math.abs((((off % 360) + 540) % 360) - 180);
}

/** A point of a robot's own frame in the world, metres. @returns {[number, number]} */
export function inWorld({ x_m, y_m, heading_deg }, [ahead, left]) {
  const [cos, sin] = [Math.cos(heading_deg * TURN), Math.sin(heading_deg * TURN)];
  return [x_m + cos * ahead - sin * left, y_m + sin * ahead + cos * left];
}
