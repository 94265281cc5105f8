// state.js -- what a view shows, as a URL keeps it: the camera, isovalue, colours.
// The first part of an ES module (front_end.py).

/** @typedef {[number, number, number]} Vec */
/** @typedef {{eye: Vec, at: Vec, up: Vec, fovy_deg: number, parallel_height?: number}} Camera
 *    world space. parallel_height: of the picture in parallel projection */
/** @typedef {{surfaces: Surface[], selected: number, camera: ?Camera,
 *    background: ?string, background_top: ?string, samples: number, max_error: ?number, by: string,
 *    time_budget: ?number, voxel_pixels: ?number, ambient: number, clip: number[], caps: boolean,
 *    color_map: ?ColorMap, planes: {normal: Vec, offset: number}[],
 *    lights: ?Record<string, number>, light: ?Vec, shadow: ?Shadow, bounce: number,
 *    slices: Slice[], slice_map: SliceMap, labels: Group[], step: number,
 *    annotations: Annotations}} State
 *    what the URL keeps, but for the surface that is selected. clip: from and to along x, y and z
 *    [% of the volume's box]. planes: further clipping planes, of a scene file. step: of a
 *    series, from 0. bounce: rays of a hit that bring light. background_top: colour at the upper
 *    edge, to which the background goes */

// Colours and numbers as messages and elements have them.
const toRgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
const toText = (value) => String(Number(Number(value).toPrecision(6)));
const toShort = (value) => String(Number(Number(value).toPrecision(3)));
const toMiB = (bytes) => `${Math.round(bytes / 2 ** 20).toLocaleString("en")} MiB`;
const toCount = (n) => (n === null || n === undefined ? "–" : n.toLocaleString("en"));

// Vectors.
const add = (a, b) => a.map((x, i) => x + b[i]);
const sub = (a, b) => a.map((x, i) => x - b[i]);
const scale = (a, s) => a.map((x) => x * s);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
const length = (a) => Math.hypot(...a);
const unit = (a) => scale(a, 1 / length(a));
const clamp = (x, low, high) => Math.min(high, Math.max(low, x));

/** Throws  Error that says what is wrong with a camera */
function checkCamera(camera) {
  for (const key of ["eye", "at", "up"]) {
    const v = camera[key];
    if (!Array.isArray(v) || v.length !== 3 || !v.every(Number.isFinite)) {
      throw new Error(`"${key}" must be three numbers, such as [0, 1, 0].`);
    }
    if (v.some((x) => Math.abs(x) > 1e18)) throw new Error(`"${key}" is too large.`);
  }
  if (!(camera.fovy_deg >= 0.001 && camera.fovy_deg <= 179.999)) {
    throw new Error('"fovy_deg" must be an angle between 0 and 180 degrees.');
  }
  const forward = sub(camera.at, camera.eye);
  if (!(length(forward) > 1e-12 * Math.max(...[...camera.at, ...camera.eye].map(Math.abs)))) {
    throw new Error('"eye" and "at" are the same point.');
  }
  const cosine = length(camera.up) > 0 ? dot(unit(forward), unit(camera.up)) : 1;
  if (Math.abs(cosine) > 1 - 1e-12) throw new Error('"up" is parallel to the view, or zero.');
  const { eye, at, up, fovy_deg, parallel_height: high } = camera;
  if (typeof high !== "number") return { eye, at, up, fovy_deg };
  if (!(high >= 1e-18 && high <= 1e18)) {
    throw new Error('"parallel_height" must be a height from 1e-18 to 1e18.');
  }
  return { eye, at, up, fovy_deg, parallel_height: high };
}

/** A camera as scene files have it. */
const sceneCamera = ({ fovy_deg, ...camera }) => ({ ...camera, fovy_degrees: fovy_deg });

/**
 * The first camera of a camera file.
 * @param {string} text JSON: {"fovy_deg": F, "cameras": [{"eye", "at", "up"}]}
 * @returns {Camera}
 * @throws {Error} that says what is wrong with it
 */
export function readCamera(text) {
  let file;
  try {
    file = JSON.parse(text);
  } catch {
    throw new Error('This is no camera: it must be JSON with "fovy_deg" and "cameras".');
  }
  const first = file?.cameras?.[0];
  if (typeof first !== "object" || first === null) {
    throw new Error('This is no camera: "cameras" with "eye", "at" and "up" is missing.');
  }
  return checkCamera({ up: [0, 1, 0], ...first, fovy_deg: file.fovy_deg ?? 60 });
}

/** A camera file of one camera. */
export function writeCamera(camera, width, height) {
  const { fovy_deg, ...one } = camera;
  return JSON.stringify({ width, height, fovy_deg, cameras: [one] });
}

/** The state as a URL's hash; what is not set is left out. */
export function writeHash(state) {
  const short = (v) => String(Number(v.toPrecision(9)));
  const { camera } = state;
  const parts = writeSurfaces(state.surfaces);
  if (state.background) parts.background = state.background.slice(1);
  if (state.background_top) parts.top = state.background_top.slice(1);
  Object.assign(parts, writeQuality(state));
  if (state.clip.some((percent, i) => percent !== WHOLE[i])) parts.clip = state.clip.join(",");
  if (!state.caps) parts.caps = 0;
  Object.assign(parts, writeLook(state), writeSlices(state), writeLabels(state),
    writeAnnotations(state));
  if (state.step) parts.step = state.step;
  if (camera) {
    for (const key of ["eye", "at", "up"]) parts[key] = camera[key].map(short).join(",");
    parts.fovy = short(camera.fovy_deg);
    if (camera.parallel_height) parts.parallel = short(camera.parallel_height);
  }
  return "#" + Object.entries(parts).map(([k, v]) => `${k}=${v}`).join("&");
}

/**
 * What a URL's hash says; parts that are not understood are left out.
 * @param {string} hash
 * @param {State} before an isovalue or a colour alone changes its selected surface
 * @returns {Partial<State>}
 */
export function readHash(hash, before) {
  const parts = new URLSearchParams(hash.replace(/^#/, ""));
  const number = (key, low, high) => {
    const value = parts.get(key) ? Number(parts.get(key)) : NaN;
    return value >= low && value <= high ? value : undefined;
  };
  const color = (key) =>
    /^[0-9a-f]{6}$/i.test(parts.get(key) ?? "") ? `#${parts.get(key)}` : undefined;
  const vector = (key) => (parts.get(key) ?? "").split(",").map(Number);
  const [isovalue, hex] = [number("iso", -3.4e38, 3.4e38), color("color")];
  const { isovalue: value, color: other } = before.surfaces[before.selected];
  const one = [makeSurface(isovalue ?? value, hex ?? other)];
  const surfaces = readSurfaces(parts.get("surfaces") ?? "")
    ?? (isovalue === undefined && hex === undefined ? undefined : one);
  const state = {
    surfaces,
    selected: surfaces && 0,
    background: color("background"),
    background_top: color("top"),
    ...readQuality(parts, number, before),
    clip: [vector("clip")].find(isClip),
    caps: number("caps", 0, 0) === 0 ? false : undefined,
    ...readLook(parts),
    ...readSlices(parts),
    ...readLabels(parts),
    ...readAnnotations(parts),
    step: [number("step", 0, 1e9)].find(Number.isInteger),
  };
  if (parts.has("eye")) {
    try {
      const [eye, at, up] = ["eye", "at", "up"].map(vector);
      state.camera = checkCamera({ eye, at, up, fovy_deg: number("fovy", 0.001, 179.999),
        parallel_height: number("parallel", 1e-18, 1e18) });
    } catch {
      // A camera that cannot be used: the view stays as it is.
    }
  }
  const understood = Object.fromEntries(Object.entries(state).filter(([, v]) => v !== undefined));
  return fitSlices(before, understood);
}
