// view.js -- the viewer of isowave: pictures come from a scene (scene.py), wishes go to it.
//
// Two homes. A page of the server loads it: connect() talks through a websocket. A notebook's front
// end imports it: the default export is a widget of anywidget, through the kernel's channel.
//
// What the front end says (protocol.py checks it): hello, wish, ack, budget. What it hears:
//
//   welcome    title, shape [z,y,x], spacing, dtype, range [low, high], bits_per_voxel,
//              max_error of voxels, isovalue
//   status     state: starting, ready, failed; device, notice (what it computes otherwise than
//              the host, or ""), device_memory, memory_bytes, memory_budget, nbytes of the
//              compressed volume
//   histogram  counts of equally wide bins, range
//   picture    wish, frame, stage: first, pass, whole, lossless; format, size, samples, ambient,
//              camera, isovalue, complete, passes, decoded_blocks, percent, ms, detail;
//              reduced: why a finished one has fewer rays than its wish, or null; notice: of a
//              finished one, that the isovalue is outside the volume's values, or ""; and its bytes
//   bounds     wish, within_pixel: the share of the surface that is certainly so near to that of
//              the volume before compression; null: there is no surface. errors_are_stated: that
//              is certain only if the errors are right that the volume's file states
//   error      message, wish or null: of none
//   closed     message, retry: whether to connect again
//
// A wish is numbered; a picture is shown only if no picture of a later wish, and none with a higher
// frame number, was shown before. Event "isowave:shown" tells which one was.

/** @typedef {[number, number, number]} Vec */
/** @typedef {{eye: Vec, at: Vec, up: Vec, fovy_deg: number}} Camera world space */
/** @typedef {{isovalue: number, camera: ?Camera, color: string, background: ?string,
 *    samples: number, max_error: ?number, time_budget: ?number, ambient: number}} State
 *    what the URL keeps */
/** @typedef {Record<string, any>} Message */
/**
 * @typedef {{send: (message: Message) => void, wheel: (view: View) => boolean, hash: boolean,
 *    isDark: () => boolean}} Home where a view is. wheel: whether the wheel is the view's
 */

const VERSION = 2;
const MIN_WAIT_MS = 15; // between two wishes
const MAX_IN_WAIT_MS = 120; // for a picture of the last wish, before the next one is sent
const MAX_PIXEL_RATIO = 2;
const ORBIT_STEP = Math.PI / 36; // of an arrow key
const PAN_STEP = 0.05; // of the picture's height
const ZOOM_STEP = 1.15;
const AMBIENT = [8, 16, 32, 64]; // rays of a hit that one can choose
const DARK = "(prefers-color-scheme: dark)";
const THUMB = 12; // width of the slider's thumb, CSS pixels

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

/** v turned about a unit axis [radians] (Rodrigues). */
function turn(v, axis, angle) {
  const c = Math.cos(angle);
  const along = scale(axis, dot(axis, v) * (1 - c));
  return add(add(scale(v, c), scale(cross(axis, v), Math.sin(angle))), along);
}

/** The eye goes around `at`: yaw to the left of up, pitch towards up [radians]. */
export function orbit(camera, yaw, pitch) {
  const up = unit(camera.up);
  const away = turn(sub(camera.eye, camera.at), up, -yaw);
  const polar = Math.acos(clamp(dot(unit(away), up), -1, 1));
  const next = clamp(polar - pitch, 0.02, Math.PI - 0.02);
  const eye = add(camera.at, turn(away, unit(cross(up, away)), next - polar));
  return { ...camera, eye };
}

/** Eye and at move so that the surface follows by dx, dy [picture heights; y down]. */
export function pan(camera, dx, dy) {
  const forward = sub(camera.at, camera.eye);
  const height = 2 * length(forward) * Math.tan((camera.fovy_deg * Math.PI) / 360);
  const right = unit(cross(forward, camera.up));
  const up = cross(right, unit(forward));
  const move = add(scale(right, -dx * height), scale(up, dy * height));
  return { ...camera, eye: add(camera.eye, move), at: add(camera.at, move) };
}

/** The eye's distance from `at` is multiplied by a factor. */
export function zoom(camera, factor) {
  const away = scale(sub(camera.eye, camera.at), factor);
  return length(away) > 0 ? { ...camera, eye: add(camera.at, away) } : camera;
}

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
  const { eye, at, up, fovy_deg } = camera;
  return { eye, at, up, fovy_deg };
}

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
  if (first.parallel_height !== undefined) {
    throw new Error('This page draws in perspective alone: leave out "parallel_height".');
  }
  return checkCamera({ up: [0, 1, 0], ...first, fovy_deg: file.fovy_deg ?? 60 });
}

/** A camera file of one camera. */
export function writeCamera(camera, width, height) {
  const { eye, at, up, fovy_deg } = camera;
  return JSON.stringify({ width, height, fovy_deg, cameras: [{ eye, at, up }] });
}

/** The state as a URL's hash; what is not set is left out. */
export function writeHash(state) {
  const short = (v) => String(Number(v.toPrecision(9)));
  const { camera } = state;
  const parts = { iso: short(state.isovalue), color: state.color.slice(1) };
  if (state.background) parts.background = state.background.slice(1);
  if (state.samples > 1) parts.samples = state.samples;
  if (state.max_error) parts.error = short(state.max_error);
  if (state.time_budget) parts.ms = short(state.time_budget);
  if (state.ambient) parts.ambient = state.ambient;
  if (camera) {
    for (const key of ["eye", "at", "up"]) parts[key] = camera[key].map(short).join(",");
    parts.fovy = short(camera.fovy_deg);
  }
  return "#" + Object.entries(parts).map(([k, v]) => `${k}=${v}`).join("&");
}

/**
 * What a URL's hash says; parts that are not understood are left out.
 * @param {string} hash
 * @returns {Partial<State>}
 */
export function readHash(hash) {
  const parts = new URLSearchParams(hash.replace(/^#/, ""));
  const number = (key, low, high) => {
    const value = parts.get(key) ? Number(parts.get(key)) : NaN;
    return value >= low && value <= high ? value : undefined;
  };
  const color = (key) =>
    /^[0-9a-f]{6}$/i.test(parts.get(key) ?? "") ? `#${parts.get(key)}` : undefined;
  const vector = (key) => (parts.get(key) ?? "").split(",").map(Number);
  const state = {
    isovalue: number("iso", -3.4e38, 3.4e38),
    color: color("color"),
    background: color("background"),
    samples: [1, 2, 3, 4].find((n) => n === number("samples", 1, 4)),
    max_error: number("error", 0.001, 1000),
    time_budget: parts.has("error") ? undefined : number("ms", 1, 10000),
    ambient: [0, ...AMBIENT].find((n) => n === number("ambient", 0, 255)),
  };
  if (parts.has("eye")) {
    try {
      const [eye, at, up] = ["eye", "at", "up"].map(vector);
      state.camera = checkCamera({ eye, at, up, fovy_deg: number("fovy", 0.001, 179.999) });
    } catch {
      // A camera that cannot be used: the view stays as it is.
    }
  }
  return Object.fromEntries(Object.entries(state).filter(([, v]) => v !== undefined));
}

const toRgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
const toText = (value) => String(Number(Number(value).toPrecision(6)));
const toShort = (value) => String(Number(Number(value).toPrecision(3)));
const toMiB = (bytes) => `${Math.round(bytes / 2 ** 20).toLocaleString("en")} MiB`;
const isFresher = (a, b) => a.wish > b.wish || (a.wish === b.wish && a.frame > b.frame);
const toCount = (n) => (n === null || n === undefined ? "–" : n.toLocaleString("en"));

const HTML = `
<div class="frame">
  <section class="stage" aria-label="Picture">
    <canvas class="picture" tabindex="0" role="application" aria-describedby="keys"
      aria-label="Isosurface; arrow keys turn it"></canvas>
    <div class="bar" aria-hidden="true"></div>
    <p class="note" role="alert" hidden></p>
    <button class="toggle" type="button" aria-controls="panel" aria-expanded="true">Panel</button>
  </section>
  <section class="iso" aria-label="Isovalue">
    <label class="number">Isovalue
      <input name="isovalue" type="number" step="any" min="-3.4e38" max="3.4e38" required></label>
    <div class="histogram">
      <canvas aria-hidden="true"></canvas>
      <input name="slider" type="range" aria-label="Isovalue on the histogram" min="0" max="1">
      <div class="ends" aria-hidden="true">
        <span></span><span>voxels, log scale</span><span></span></div>
    </div>
  </section>
  <aside class="panel" id="panel" aria-label="Settings">
    <h1></h1><p class="volume"></p>
    <div class="buttons">
      <button type="button" name="reset">Reset view</button>
      <button type="button" name="shot">Screenshot</button>
      <button type="button" name="copy">Copy camera</button>
      <button type="button" name="paste" aria-expanded="false">Paste camera</button>
    </div>
    <form class="paste" hidden>
      <label>Camera file (JSON)
        <textarea name="camera" rows="4" spellcheck="false"></textarea></label>
      <p class="problem" role="alert"></p>
      <div class="buttons">
        <button>Use it</button><button type="button" name="cancel">Cancel</button></div>
    </form>
    <h2>Colour</h2>
    <label>Surface <input name="color" type="color"></label>
    <label>Background <input name="background" type="color"></label>
    <h2>Quality</h2>
    <label>Largest error <span class="unit"><input name="max_error" type="number"
      min="0.001" max="1000"
      step="any" placeholder="none"> px</span></label>
    <label>Samples per pixel <select name="samples"><option value="1">1</option>
      <option value="2">4</option><option value="3">9</option><option value="4">16</option></select>
    </label>
    <label title="Rays of each point that find out how much of the sky it sees">Ambient rays
      <select name="ambient"><option value="0">none</option>${
  AMBIENT.map((n) => `<option>${n}</option>`).join("")}</select></label>
    <label>Time budget <span class="unit"><input name="time_budget" type="number"
      min="1" max="10000" step="any"
      placeholder="none"> ms</span></label>
    <h2>Device</h2>
    <form class="budget"><label>Memory budget <span class="unit"><input name="budget" type="number"
      min="1"
      max="9000000" step="1" placeholder="default"> MiB</span></label></form>
    <dl class="device"></dl>
    <h2>This picture</h2>
    <dl class="facts"></dl>
    <details><summary>Keys and gestures</summary><p id="keys">Drag, one finger or arrow keys: turn.
      Right drag, shift and drag, two fingers or shift and arrows: move. Wheel, pinch, + and −:
      zoom. 0 or double click: reset. The keys work while the picture has the focus.</p></details>
  </aside>
  <p class="said" role="status"></p>
</div>`;

const CSS = `
:host { display: block; container-type: size; position: relative; overflow: hidden;
  --back: light-dark(#f3f4f6, #14171a); --card: light-dark(#ffffff, #1b1f24);
  --text: light-dark(#1b2128, #e5e9ed); --soft: light-dark(#55606b, #a2adb8);
  --line: light-dark(#d9dde2, #30363d); --edge: light-dark(#7c8791, #7d8894);
  --field: light-dark(#ffffff, #14171a); --accent: light-dark(#0b63a5, #74b7f0);
  --bars: light-dark(#9aa5b1, #5c6873); --bad: light-dark(#a3231c, #ff9d92);
  color: var(--text); background: var(--back); color-scheme: light dark;
  font: 13px/1.45 system-ui, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
* { box-sizing: border-box; }
[hidden] { display: none !important; }
.frame { display: grid; height: 100%; grid: minmax(0, 1fr) auto / minmax(0, 1fr) auto;
  grid-template-areas: "stage panel" "iso panel"; }
.stage { grid-area: stage; position: relative; min-height: 0; }
.picture { position: absolute; inset: 0; width: 100%; height: 100%; touch-action: none;
  cursor: grab; }
.picture:active { cursor: grabbing; }
.bar { position: absolute; inset: 0 auto auto 0; height: 2px; width: 0; background: var(--accent);
  opacity: 0; transition: width .15s, opacity .3s .2s; }
.bar.busy { opacity: 1; }
.note { position: absolute; left: 12px; bottom: 12px; max-width: calc(100% - 24px); margin: 0;
  padding: 8px 12px; border: 1px solid var(--edge); border-radius: 6px; background: var(--card); }
.toggle { position: absolute; top: 10px; right: 10px; }
.iso { grid-area: iso; display: flex; gap: 16px; align-items: start; padding: 10px 16px 8px;
  background: var(--card); border-top: 1px solid var(--line); }
.iso .number { display: block; width: 104px; flex: none; }
.iso .number input { width: 100%; margin-top: 2px; }
.histogram { position: relative; flex: 1; min-width: 0; }
.histogram canvas { color: var(--accent); outline: 0 solid var(--bars); display: block;
  width: 100%; height: 44px; }
.histogram input { position: absolute; inset: 0 0 auto; width: 100%; height: 44px; margin: 0;
  appearance: none; background: none; cursor: ew-resize; border-radius: 3px; }
.histogram input::-webkit-slider-thumb { appearance: none; width: ${THUMB}px; height: 44px;
  background: linear-gradient(var(--accent), var(--accent)) center / 2px 100% no-repeat,
    radial-gradient(circle at 50% 50%, var(--accent) 5px, transparent 5.8px); }
.histogram input::-moz-range-thumb { width: ${THUMB}px; height: 44px; border: 0; border-radius: 0;
  background: linear-gradient(var(--accent), var(--accent)) center / 2px 100% no-repeat,
    radial-gradient(circle at 50% 50%, var(--accent) 5px, transparent 5.8px); }
.ends { display: flex; justify-content: space-between; padding: 0 ${THUMB / 2}px;
  color: var(--soft); font-size: 11px;
  font-variant-numeric: tabular-nums; }
.panel { grid-area: panel; width: 268px; padding: 12px 14px; overflow: auto;
  background: var(--card); border-left: 1px solid var(--line); }
.panel h1 { margin: 0; font-size: 14px; font-weight: 600; overflow-wrap: anywhere; }
.panel h2 { margin: 14px 0 4px; font-size: 11px; font-weight: 600; color: var(--soft);
  letter-spacing: .04em; text-transform: uppercase; }
.volume { margin: 0 0 10px; color: var(--soft); font-size: 12px; }
.panel label { display: flex; justify-content: space-between; align-items: center; gap: 8px;
  min-height: 30px; }
.panel :is(select, input[type=color]) { flex: none; width: 76px; margin-right: 32px; }
.buttons { display: grid; grid-template-columns: 1fr 1fr; gap: 6px; }
.paste { margin-top: 8px; }
.paste label { display: block; }
.problem { margin: 4px 0; color: var(--bad); }
button, input, select, textarea { font: inherit; color: inherit; }
button, input[type=number], select, textarea { border: 1px solid var(--edge); border-radius: 4px;
  background: var(--field); padding: 0 8px; height: 28px; }
button { cursor: pointer; background: var(--card); white-space: nowrap; }
button:hover { border-color: var(--accent); color: var(--accent); }
.unit { display: grid; grid-template-columns: 76px 26px; align-items: center; gap: 6px; }
.panel input[type=number] { width: 100%; text-align: right; appearance: textfield; }
input::-webkit-inner-spin-button { display: none; }
input::placeholder { color: var(--soft); opacity: 1; }
input[type=color] { height: 26px; padding: 2px; border: 1px solid var(--edge);
  border-radius: 4px; background: var(--field); cursor: pointer; }
input:invalid { border-color: var(--bad); outline-color: var(--bad); }
textarea { width: 100%; height: auto; padding: 4px 8px; resize: vertical;
  font: 12px/1.4 ui-monospace, monospace; }
:focus-visible { outline: 2px solid var(--accent); outline-offset: 2px; }
.picture:focus-visible, .histogram input:focus-visible { outline-offset: -2px; }
dl { display: grid; grid-template-columns: auto 1fr; gap: 2px 10px; margin: 4px 0; }
dt { color: var(--soft); }
dd { margin: 0; text-align: right; overflow-wrap: anywhere; font-variant-numeric: tabular-nums; }
details { margin-top: 14px; color: var(--soft); font-size: 12px; }
summary { cursor: pointer; }
.said { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%);
  margin: 0; }
.closed .panel { display: none; }
@container (max-width: 640px) {
  .frame { overflow: auto; grid: minmax(220px, 1fr) auto auto / minmax(0, 1fr);
    grid-template-areas: "stage" "iso" "panel"; }
  .frame:not(.closed) { grid-template-rows: max(220px, 55cqh) auto auto; }
  .iso { gap: 10px; padding: 8px 10px; }
  .iso .number { width: 84px; }
  .panel { width: auto; border: 0; border-top: 1px solid var(--line); overflow: visible; }
}
@media (pointer: coarse) { button, input[type=number], select { height: 36px; }
  .panel label { min-height: 40px; } }
@media (prefers-reduced-motion: reduce) { * { transition: none !important; } }
`;

/** One view: its elements, its state, and what it has shown. */
class View {
  /**
   * @param {HTMLElement} host
   * @param {Home} home
   */
  constructor(host, home) {
    this.host = host;
    this.home = home;
    this.root = host.shadowRoot ?? host.attachShadow({ mode: "open" });
    this.root.innerHTML = HTML;
    const sheet = new CSSStyleSheet();
    sheet.replaceSync(CSS);
    this.root.adoptedStyleSheets = [sheet];
    host.dataset.lmSuppressShortcuts = "true"; // JupyterLab's, while the focus is in here
    this.find = (selector) => this.root.querySelector(selector);
    this.picture = this.find(".picture");
    this.field = (name) => this.find(`[name=${name}]`);
    /** @type {State} */
    this.state = { isovalue: NaN, camera: null, color: "#dbbd87", background: null, samples: 1,
      max_error: null, time_budget: null, ambient: 0 };
    if (home.hash) Object.assign(this.state, readHash(location.hash));
    this.wish = 0;
    this.shown = this.arrived = { wish: -1, frame: -1 };
    this.answered = true; // there is a picture of the last wish, or an error
    this.sentAt = -Infinity;
    this.scheduled = this.held = 0;
    this.ended = new AbortController();
    this.listen();
    this.showState();
    this.setOpen(host.clientWidth > 640);
  }

  // From the scene.

  /** A new connection: what was asked for must be asked for again. */
  connected() {
    this.shown = this.arrived = { wish: this.shown.wish, frame: -1 };
    this.volume = null;
    this.note("Starting …", "passing");
    this.home.send({ type: "hello", version: VERSION });
  }

  /**
   * @param {Message} head
   * @param {BlobPart=} data of a picture
   */
  receive(head, data) {
    const takers = { welcome: this.welcome, status: this.showStatus, error: this.showError,
      histogram: this.showHistogram, bounds: this.showBounds };
    if (head.type === "picture") return this.showPicture(head, data);
    takers[head.type]?.call(this, head);
  }

  welcome(head) {
    this.volume = head;
    const [z, y, x] = head.shape;
    this.find("h1").textContent = head.title || "Volume";
    this.find(".volume").textContent =
      `${x} × ${y} × ${z} ${head.dtype}, ${toShort(head.bits_per_voxel)} bits per voxel`;
    if (this.home.hash && head.title) document.title = `${head.title} – isowave`;
    if (!Number.isFinite(this.state.isovalue)) this.state.isovalue = head.isovalue;
    this.setRange(head.range);
    this.push();
  }

  setRange([low, high]) {
    const slider = this.field("slider");
    const whole = /int/.test(this.volume.dtype);
    const step = (high - low) / 1000;
    Object.assign(slider, { min: low, max: high });
    slider.step = whole ? Math.max(1, Math.round(step)) : step;
    const [left, , right] = this.root.querySelectorAll(".ends span");
    [left.textContent, right.textContent] = [toText(low), toText(high)];
    this.range = [low, high];
    this.showState();
  }

  showStatus(head) {
    const ready = head.state === "ready";
    this.host.dataset.state = head.state;
    if (head.state === "starting") this.note("Preparing the device …", "passing");
    else this.clearNote("passing");
    this.list(".device", ready ? {
      Device: head.device,
      ...(head.notice && { Arithmetic: head.notice }),
      Memory: `${toMiB(head.memory_bytes)} of ${toMiB(head.device_memory)}`,
      Volume: `${toMiB(head.nbytes)}, compressed`,
    } : { Device: head.state === "failed" ? "none" : "starting …" });
    const budget = this.field("budget");
    if (this.root.activeElement !== budget) {
      budget.value = head.memory_budget ? Math.round(head.memory_budget / 2 ** 20) : "";
    }
    if (ready && this.failed) this.push();
  }

  showError(head) {
    if (head.wish !== null) {
      this.answered = this.failed = true;
      this.progress(100);
    }
    this.note(head.message, head.wish === null ? "error" : "drawing");
  }

  async showPicture(head, data) {
    const { connection } = this;
    // Bitmaps may be ready in another order than they came in.
    if (isFresher(head, this.arrived)) {
      this.arrived = head;
      try {
        const bitmap = await createImageBitmap(new Blob([data], { type: `image/${head.format}` }));
        if (isFresher(head, this.shown)) this.draw(head, bitmap, data);
        bitmap.close();
      } catch {
        this.note("A picture could not be read.", "drawing");
      }
    }
    if (connection === this.connection) this.home.send({ type: "ack", frame: head.frame });
  }

  draw(head, bitmap, data) {
    this.shown = { wish: head.wish, frame: head.frame };
    Object.assign(this.picture, { width: bitmap.width, height: bitmap.height });
    this.picture.getContext("2d").drawImage(bitmap, 0, 0);
    if (head.wish === this.wish) this.showNewest(head, data);
    const now = performance.now();
    if (head.wish >= this.began.wish) {
      this.host.dataset.firstMs = (now - this.began.at).toFixed(1);
      this.began = { wish: Infinity, at: 0 };
    }
    Object.assign(this.host.dataset, { shown: head.wish, stage: head.stage });
    const detail = { wish: head.wish, frame: head.frame, stage: head.stage };
    this.host.dispatchEvent(new CustomEvent("isowave:shown", { detail, bubbles: true }));
    if (head.wish === this.wish) this.sendHeldBack();
  }

  /** A picture of what is wished for now. */
  showNewest(head, data) {
    this.answered = true;
    this.failed = false;
    this.clearNote("passing", "drawing");
    if (!this.state.camera) this.state.camera = head.camera;
    const rest = head.stage === "whole" || head.stage === "lossless";
    this.progress(rest ? 100 : head.percent ?? 50);
    if (rest) this.showFacts(head);
    const notes = [head.notice, head.reduced].filter(Boolean);
    if (rest && notes.length) this.note(notes.join(" "), "drawing");
    if (head.stage === "lossless") {
      this.lossless = { wish: head.wish, blob: new Blob([data], { type: "image/png" }) };
      if (this.wantsShot) this.download();
      this.say(`Isovalue ${toText(head.isovalue)}, ${head.complete ? "" : "not "}complete.`);
      this.keepHash();
    }
  }

  showFacts(head) {
    const detail = this.state.max_error ? `most pixels within ${toText(this.state.max_error)} px`
      : "at full detail";
    const certain = !head.complete ? "the time was over: not complete"
      : head.detail?.reachable === false ? head.detail.advice || "that error is out of reach"
        : `complete, ${detail}`;
    const rays = head.samples > 1 ? `, ${head.samples ** 2} rays a pixel` : "";
    this.list(".facts", {
      Size: `${head.size[0]} × ${head.size[1]}${rays}`,
      Passes: toCount(head.passes),
      "Blocks decoded": toCount(head.decoded_blocks),
      Time: `${toShort(head.ms)} ms`,
      Picture: certain,
    });
  }

  /** How near the surface is to that of the volume before compression. */
  showBounds(head) {
    if (head.wish !== this.wish || head.within_pixel === null) return;
    const percent = Math.floor(1000 * head.within_pixel) / 10;
    const [name, value] = [document.createElement("dt"), document.createElement("dd")];
    name.textContent = head.errors_are_stated ? "By its file" : "Certain";
    value.textContent = `${percent} % within 1 px`;
    value.title = "of the surface: no further from that of the volume before compression"
        + (head.errors_are_stated ? ", if the errors are right that the file states" : "");
    this.find(".facts").append(name, value);
  }

  list(selector, facts) {
    this.find(selector).replaceChildren(...Object.entries(facts).flatMap(([name, value]) => {
      const [dt, dd] = [document.createElement("dt"), document.createElement("dd")];
      [dt.textContent, dd.textContent] = [name, value];
      return [dt, dd];
    }));
  }

  showHistogram(head) {
    this.histogram = head;
    this.drawHistogram();
  }

  /** Bars of log(1 + count); those that the surface encloses in the accent's colour. */
  drawHistogram() {
    const canvas = this.find(".histogram canvas");
    const ratio = devicePixelRatio;
    const [width, height] = [canvas.clientWidth * ratio, canvas.clientHeight * ratio];
    if (!this.histogram || !this.range || !(width > 0)) return;
    Object.assign(canvas, { width, height });
    const context = canvas.getContext("2d");
    const { color, outlineColor } = getComputedStyle(canvas); // the bars', in this scheme
    const { counts, range: [from, to] } = this.histogram;
    const [low, high] = this.range;
    const inset = (THUMB / 2) * ratio; // the thumb's middle goes from here to there
    const x = (v) => Math.round(inset + ((v - low) / (high - low || 1)) * (width - 2 * inset));
    const most = Math.log1p(Math.max(...counts, 1));
    counts.forEach((count, i) => {
      const [a, b] = [i, i + 1].map((k) => from + ((to - from) * k) / counts.length);
      const bar = (Math.log1p(count) / most) * (height - ratio);
      const inside = b > this.state.isovalue;
      context.fillStyle = inside ? color : outlineColor;
      context.globalAlpha = inside ? 0.55 : 1;
      context.fillRect(x(a), height - bar, Math.max(1, x(b) - x(a)), bar);
    });
  }

  // To the scene.

  /** Wishes for the state at hand, soon: at most once a frame, and when the last is answered. */
  push() {
    if (this.scheduled || this.held || !this.volume) return;
    this.scheduled = requestAnimationFrame(() => {
      this.scheduled = 0;
      const waited = performance.now() - this.sentAt;
      const left = (this.answered ? MIN_WAIT_MS : MAX_IN_WAIT_MS) - waited;
      if (left > 0) this.held = setTimeout(() => this.sendHeldBack(), left);
      else this.sendWish();
    });
  }

  /** What push() held back: a picture has come, or has not for long enough. */
  sendHeldBack() {
    if (!this.held || performance.now() - this.sentAt < MIN_WAIT_MS - 1) return;
    clearTimeout(this.held);
    this.held = 0;
    this.sendWish();
  }

  sendWish() {
    const { width, height } = this.picture.getBoundingClientRect();
    if (!(width >= 1 && height >= 1)) return; // hidden: the observer pushes when it is not
    const ratio = Math.min(devicePixelRatio, MAX_PIXEL_RATIO);
    const { background, color, ...rest } = this.state;
    this.wish += 1;
    this.answered = false;
    this.sentAt = performance.now();
    if (!(this.began.wish <= this.wish)) this.began = { wish: this.wish, at: this.sentAt };
    this.host.dataset.wish = this.wish;
    this.progress(0);
    this.home.send({
      type: "wish",
      id: this.wish,
      size: [width, height].map((side) => clamp(Math.round(side * ratio), 1, 8192)),
      color: toRgb(color),
      background: toRgb(this.backgroundShown()),
      ...rest,
    });
  }

  /** Changes the state, shows it, wishes for it. */
  change(changes) {
    Object.assign(this.state, changes);
    // A frame keeps an error or a time; what was given last counts.
    if (changes.time_budget) this.state.max_error = null;
    else if (changes.max_error) this.state.time_budget = null;
    this.clearNote("error");
    this.showState();
    this.push();
  }

  /** Moves the camera, but not to where it looks nowhere. */
  move(moved) {
    if (!this.state.camera) return;
    try {
      this.change({ camera: checkCamera(moved(this.state.camera)) });
    } catch {
      // As near or as far as numbers go.
    }
  }

  backgroundShown() {
    return this.state.background ?? (this.home.isDark() ? "#14171a" : "#ffffff");
  }

  // What the elements show.

  showState() {
    const { state } = this;
    const value = Number.isFinite(state.isovalue) ? toText(state.isovalue) : "";
    this.set("isovalue", value);
    this.field("slider").value = state.isovalue;
    this.field("slider").setAttribute("aria-valuetext", value);
    this.field("color").value = state.color;
    this.field("background").value = this.backgroundShown();
    this.field("samples").value = state.samples;
    this.field("ambient").value = state.ambient;
    this.set("max_error", state.max_error ?? "");
    this.set("time_budget", state.time_budget ?? "");
    this.drawHistogram();
  }

  /** Not while somebody types there. */
  set(name, value) {
    const field = this.field(name);
    if (this.root.activeElement !== field) field.value = value;
  }

  /**
   * @param {string} text
   * @param {"passing" | "drawing" | "error"} kind what makes it go: the device is ready; a picture
   *    of the newest wish; the next thing that somebody does. Passing ones give way to others.
   */
  note(text, kind) {
    const note = this.find(".note");
    if (kind === "passing" && !note.hidden && this.noteKind !== "passing") return;
    Object.assign(note, { textContent: text, hidden: false });
    this.noteKind = kind;
  }

  clearNote(...kinds) {
    if (kinds.includes(this.noteKind)) this.find(".note").hidden = true;
  }

  say(text) {
    this.find(".said").textContent = text;
  }

  progress(percent) {
    const bar = this.find(".bar");
    bar.style.width = `${percent}%`;
    bar.classList.toggle("busy", percent < 100);
  }

  setOpen(open) {
    this.find(".frame").classList.toggle("closed", !open);
    this.find(".toggle").setAttribute("aria-expanded", open);
  }

  keepHash() {
    if (!this.home.hash) return;
    history.replaceState(null, "", writeHash(this.state));
  }

  // From people.

  listen() {
    const { signal } = this.ended;
    const on = (target, type, act, options) =>
      target.addEventListener(type, act, { signal, ...options });
    this.began = { wish: Infinity, at: 0 };
    on(this.root, "keydown", (e) => e.stopPropagation()); // notebooks have keys of their own
    this.listenToPicture(on);
    this.listenToFields(on);
    on(matchMedia(DARK), "change", () => this.change({}));
    if (this.home.hash) {
      on(window, "hashchange", () => this.change(readHash(location.hash)));
    }
    const observer = new ResizeObserver(() => {
      this.drawHistogram();
      this.push();
    });
    observer.observe(this.picture);
    on(signal, "abort", () => observer.disconnect());
  }

  listenToPicture(on) {
    const { picture } = this;
    const fingers = new Map();
    const forget = (e) => fingers.delete(e.pointerId);
    on(picture, "pointerdown", (e) => {
      picture.setPointerCapture(e.pointerId);
      fingers.set(e.pointerId, e);
    });
    on(picture, "pointermove", (e) => {
      const last = fingers.get(e.pointerId);
      if (!last) return;
      this.drag(fingers, last, e);
      fingers.set(e.pointerId, e);
    });
    for (const type of ["pointerup", "pointercancel"]) on(picture, type, forget);
    on(picture, "contextmenu", (e) => e.preventDefault());
    on(picture, "dblclick", () => this.change({ camera: null }));
    on(picture, "wheel", (e) => this.wheel(e), { passive: false });
    on(picture, "keydown", (e) => this.key(e));
    on(this.root, "copy", (e) => this.onClipboard(e, () =>
      e.clipboardData.setData("text/plain", this.cameraText())));
    on(this.root, "paste", (e) => this.onClipboard(e, () =>
      this.pasteCamera(e.clipboardData.getData("text/plain"))));
  }

  onClipboard(event, act) {
    if (this.root.activeElement !== this.picture) return;
    event.preventDefault();
    act();
  }

  drag(fingers, last, now) {
    const height = this.picture.clientHeight;
    const dx = (now.clientX - last.clientX) / height;
    const dy = (now.clientY - last.clientY) / height;
    if (fingers.size > 1) {
      const other = [...fingers.values()].find((f) => f.pointerId !== now.pointerId);
      const apart = (f) => Math.hypot(f.clientX - other.clientX, f.clientY - other.clientY) || 1;
      const factor = apart(last) / apart(now);
      // Each finger moves the middle by half of its way.
      this.move((c) => zoom(pan(c, dx / 2, dy / 2), factor));
    } else if (now.buttons & 2 || now.buttons & 4 || now.shiftKey) {
      this.move((c) => pan(c, dx, dy));
    } else {
      this.move((c) => orbit(c, dx * Math.PI, dy * Math.PI));
    }
  }

  wheel(event) {
    if (!event.ctrlKey && !this.home.wheel(this)) return; // the page is to scroll
    event.preventDefault();
    const pixels = event.deltaY * [1, 16, 400][event.deltaMode];
    const strength = event.ctrlKey ? 0.01 : 0.001; // pinches of touchpads come as ctrl and wheel
    this.move((c) => zoom(c, Math.exp(clamp(pixels * strength, -1, 1))));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const [x, y] = arrows[event.key] ?? [0, 0];
    if (arrows[event.key]) {
      this.move((c) => (event.shiftKey ? pan(c, x * PAN_STEP, y * PAN_STEP)
        : orbit(c, x * ORBIT_STEP, y * ORBIT_STEP)));
    } else if (event.key === "+" || event.key === "=") {
      this.move((c) => zoom(c, 1 / ZOOM_STEP));
    } else if (event.key === "-" || event.key === "_") {
      this.move((c) => zoom(c, ZOOM_STEP));
    } else if (event.key === "0") {
      this.change({ camera: null });
    } else {
      return;
    }
    event.preventDefault();
  }

  listenToFields(on) {
    const number = (name, type, optional) => on(this.field(name), type, () => {
      const field = this.field(name);
      const value = field.value ? Number(field.value) : optional;
      if (field.validity.valid) this.change({ [name]: value });
    });
    number("isovalue", "input");
    number("max_error", "change", null);
    number("time_budget", "change", null);
    number("samples", "change");
    number("ambient", "change");
    on(this.field("slider"), "input", (e) => this.change({ isovalue: Number(e.target.value) }));
    for (const name of ["color", "background"]) {
      on(this.field(name), "input", (e) => this.change({ [name]: e.target.value }));
    }
    on(this.find(".budget"), "submit", (e) => this.sendBudget(e));
    on(this.field("budget"), "change", (e) => this.sendBudget(e));
    on(this.find(".toggle"), "click", () => this.setOpen(this.find(".closed") !== null));
    on(this.field("reset"), "click", () => this.change({ camera: null }));
    on(this.field("shot"), "click", () => this.shoot());
    on(this.field("copy"), "click", () => this.copyCamera());
    on(this.field("paste"), "click", () => this.openPaste(this.find("form.paste").hidden));
    on(this.field("cancel"), "click", () => this.openPaste(false));
    on(this.find("form.paste"), "submit", (e) => {
      e.preventDefault();
      if (this.pasteCamera(this.field("camera").value)) this.openPaste(false);
    });
    on(this.find("form.paste"), "keydown", (e) => e.key === "Escape" && this.openPaste(false));
  }

  sendBudget(event) {
    event.preventDefault();
    const field = this.field("budget");
    const bytes = field.value ? Math.round(Number(field.value) * 2 ** 20) : null;
    if (!field.validity.valid || bytes === this.budgetSent) return;
    this.budgetSent = bytes;
    this.home.send({ type: "budget", bytes });
  }

  // Screenshot and camera.

  shoot() {
    this.wantsShot = true;
    if (this.lossless?.wish === this.wish) this.download();
    else this.say("The screenshot follows with the lossless picture.");
  }

  download() {
    this.wantsShot = false;
    const link = document.createElement("a");
    link.href = URL.createObjectURL(this.lossless.blob);
    link.download = `isowave_${toText(this.state.isovalue)}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  cameraText() {
    return writeCamera(this.state.camera, this.picture.width, this.picture.height);
  }

  async copyCamera() {
    if (!this.state.camera) return;
    try {
      await navigator.clipboard.writeText(this.cameraText());
      this.flash("copy", "Copied");
    } catch {
      this.openPaste(true); // no access to the clipboard: there it can be copied by hand
      this.field("camera").value = this.cameraText();
      this.field("camera").select();
    }
  }

  flash(name, text) {
    const button = this.field(name);
    const before = button.dataset.text ?? button.textContent;
    Object.assign(button.dataset, { text: before });
    button.textContent = text;
    this.say(text);
    setTimeout(() => { button.textContent = before; }, 1500);
  }

  openPaste(open) {
    this.find("form.paste").hidden = !open;
    this.field("paste").setAttribute("aria-expanded", open);
    this.find(".problem").textContent = "";
    this.field(open ? "camera" : "paste").focus();
  }

  /** @returns {boolean} whether it was a camera */
  pasteCamera(text) {
    try {
      this.change({ camera: readCamera(text) });
      return true;
    } catch (error) {
      if (this.find("form.paste").hidden) this.note(error.message, "error");
      this.find(".problem").textContent = error.message;
      return false;
    }
  }

  close() {
    this.ended.abort();
    cancelAnimationFrame(this.scheduled);
    clearTimeout(this.held);
  }
}

/**
 * A view that talks to a server, and again when the connection was lost.
 * @param {HTMLElement} host
 * @param {string} url of the websocket
 */
export function connect(host, url) {
  let socket = null;
  let failures = 0;
  const send = (message) => {
    if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  };
  const view = new View(host, {
    send, wheel: () => true, hash: true, isDark: () => matchMedia(DARK).matches,
  });
  const open = () => {
    socket = new WebSocket(url);
    view.connection = socket;
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      failures = 0;
      view.connected();
    };
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") return view.receive(JSON.parse(data));
      const size = new DataView(data).getUint32(0, true);
      const head = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, size)));
      view.receive(head, new Uint8Array(data, 4 + size));
    };
    socket.onclose = ({ code, reason }) => {
      view.host.dataset.state = "closed";
      const final = code === 1008 || code === 1003 || code === 1009;
      const wait = Math.min(10000, 250 * 2 ** failures++);
      view.note(final ? `Disconnected: ${reason || "a message was too long"}. Reload the page.`
        : reason || "The connection is lost. Trying again …", "drawing");
      if (!final) setTimeout(open, wait);
    };
  };
  open();
  return view;
}

/** A view in a notebook: of anywidget. */
function render({ model, el }) {
  const host = document.createElement("div");
  const name = crypto.getRandomValues(new Uint32Array(4)).join("-");
  const send = (message) => model.send({ view: name, message });
  const wheel = (view) => view.root.activeElement === view.picture; // else the notebook scrolls
  const light = document.body.dataset.jpThemeLight; // JupyterLab's theme, whatever the system's
  const isDark = () => (light ? light === "false" : matchMedia(DARK).matches);
  if (light) host.style.colorScheme = isDark() ? "dark" : "light";
  const resize = () => { host.style.height = `${model.get("height")}px`; };
  resize();
  el.append(host);
  const view = new View(host, { send, wheel, hash: false, isDark });
  const receive = ({ view: to, message }, buffers) => {
    if (to !== name) return;
    if (message.type !== "closed") return view.receive(message, buffers?.[0]);
    view.note(`Disconnected: ${message.message}. Run the cell again.`, "drawing");
  };
  model.on("msg:custom", receive);
  model.on("change:height", resize);
  view.connected();
  return () => {
    send(null);
    model.off("msg:custom", receive);
    model.off("change:height", resize);
    view.close();
  };
}

export default { render };

/** The server's page: nothing but a view. */
function startPage() {
  const sheet = new CSSStyleSheet();
  sheet.replaceSync("body { margin: 0 } #view { height: 100vh; height: 100dvh }");
  document.adoptedStyleSheets = [sheet];
  const host = document.body.appendChild(document.createElement("main"));
  host.id = "view";
  connect(host, new URL("ws", location.href.replace(/^http/, "ws").replace(/#.*/, "")).href);
}

if (globalThis.document?.documentElement.dataset.isowave === "page") startPage();
