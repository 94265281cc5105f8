// moves.js -- how the camera moves. A part of an ES module (front_end.py).

const ORBIT_STEP = Math.PI / 36; // of an arrow key
const PAN_STEP = 0.05; // of the picture's height
const ZOOM_STEP = 1.15;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const SIDE_KEYS = { 1: "front", 3: "right", 7: "top" };

/** v turned about a unit axis [radians] (Rodrigues). */
function turn(v, axis, angle) {
  const c = Math.cos(angle);
  const along = scale(axis, dot(axis, v) * (1 - c));
  return add(add(scale(v, c), scale(cross(axis, v), Math.sin(angle))), along);
}

/**
 * The eye goes around `at`: yaw to the left of up, pitch towards up [radians]. Up is the camera's,
 * but `top` if it looks along that, as from the top and the bottom.
 */
export function orbit(camera, yaw, pitch, top = camera.up) {
  const back = sub(camera.eye, camera.at);
  const isAlong = Math.abs(dot(unit(back), unit(top))) > 0.9999;
  const up = unit(isAlong ? top : camera.up);
  const right = turn(cross(camera.up, back), up, -yaw);
  const away = turn(back, up, -yaw);
  const polar = Math.acos(clamp(dot(unit(away), up), -1, 1));
  const next = clamp(polar - pitch, 0.02, Math.PI - 0.02);
  const eye = add(camera.at, turn(away, unit(right), next - polar));
  return { ...camera, eye, up: isAlong ? up : camera.up };
}

/** Directions from a volume's middle to eyes that see its sides, as isowave::orientation_of(). */
export const sidesOf = (isAnatomical) => {
  const sides = isAnatomical ? { front: [0, -1, 0], right: [-1, 0, 0], top: [0, 0, 1] }
    : { front: [0, 0, 1], right: [1, 0, 0], top: [0, 1, 0] };
  const [back, left, bottom] = Object.values(sides).map((side) => side.map((x) => -x || 0));
  return { ...sides, back, left, bottom };
};
const VIEW_NAMES = { front: "Front", left: "Left", top: "Top", back: "Back", right: "Right",
  bottom: "Bottom" };
/** HTML of the buttons for the sides of the volume. */
const VIEW_BUTTONS = Object.entries(VIEW_NAMES).map(([side, name]) =>
  `<button type="button" data-side="${side}">${name}</button>`).join("");

/** The camera at a side of what it looks at, as far away as before. */
export function seenFrom(camera, sides, side) {
  const distance = length(sub(camera.eye, camera.at));
  const up = { top: sides.back, bottom: sides.front }[side] ?? sides.top;
  return { ...camera, eye: add(camera.at, scale(sides[side], distance)), up };
}

/** The camera at the opposite side of what it looks at. */
export function opposite(camera, top) {
  const back = sub(camera.eye, camera.at);
  const isAlong = Math.abs(dot(unit(back), unit(top))) > 0.9999;
  return { ...camera, eye: sub(camera.at, back), up: isAlong ? scale(camera.up, -1) : camera.up };
}

/** The picture's height at a distance from the eye. */
const heightAt = (camera, distance) => camera.parallel_height
  ?? 2 * distance * Math.tan((camera.fovy_deg * Math.PI) / 360);

/** Eye and at move so that the surface follows by dx, dy [picture heights; y down]. */
export function pan(camera, dx, dy) {
  const forward = sub(camera.at, camera.eye);
  const height = heightAt(camera, length(forward));
  const right = unit(cross(forward, camera.up));
  const up = cross(right, unit(forward));
  const move = add(scale(right, -dx * height), scale(up, dy * height));
  return { ...camera, eye: add(camera.eye, move), at: add(camera.at, move) };
}

/** The eye's distance from `at` is multiplied by a factor; in parallel projection the picture's
 * height is. */
export function zoom(camera, factor) {
  if (camera.parallel_height) {
    return { ...camera, parallel_height: camera.parallel_height * factor };
  }
  const away = scale(sub(camera.eye, camera.at), factor);
  return length(away) > 0 ? { ...camera, eye: add(camera.at, away) } : camera;
}

/**
 * As zoom(), but what lies under the cursor, as deep as `at`, stays there.
 * @param {number} x of the cursor from the middle, to the right [picture heights]; y: up
 */
export function zoomTo(camera, factor, x, y) {
  const forward = sub(camera.at, camera.eye);
  const height = heightAt(camera, length(forward));
  const right = unit(cross(forward, camera.up));
  const move = scale(add(scale(right, x), scale(cross(right, unit(forward)), y)),
    height * (1 - factor));
  const moved = { ...camera, eye: add(camera.eye, move), at: add(camera.at, move) };
  return zoom(moved, factor);
}

/** The picture turns clockwise [radians]. */
export function roll(camera, angle) {
  return { ...camera, up: turn(camera.up, unit(sub(camera.at, camera.eye)), -angle) };
}

/** The camera looks at a point from the same side, closer by a factor. */
export function lookAt(camera, point, factor = 1) {
  const back = sub(camera.eye, camera.at);
  return zoom({ ...camera, at: point, eye: add(point, back) }, factor);
}

/**
 * How a key moves the camera.
 * @param {KeyboardEvent} event
 * @param {Record<string, Vec>} sides sidesOf() the volume
 * @returns {?(camera: Camera) => Camera} null: not at all
 */
function moveOfKey({ key, shiftKey }, sides) {
  const [x, y] = ARROWS[key] ?? [0, 0];
  if (ARROWS[key] && shiftKey) return (c) => pan(c, x * PAN_STEP, y * PAN_STEP);
  if (ARROWS[key]) return (c) => orbit(c, x * ORBIT_STEP, y * ORBIT_STEP, sides.top);
  if (SIDE_KEYS[key]) return (c) => seenFrom(c, sides, SIDE_KEYS[key]);
  if (key === "q" || key === "e") return (c) => roll(c, key === "e" ? ORBIT_STEP : -ORBIT_STEP);
  if (key === "9") return (c) => opposite(c, sides.top);
  if (key === "+" || key === "=") return (c) => zoom(c, 1 / ZOOM_STEP);
  if (key === "-" || key === "_") return (c) => zoom(c, ZOOM_STEP);
  return null;
}
