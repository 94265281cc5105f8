// view.js -- a view: pictures come from a scene (scene.py), wishes go to it. A part of
// an ES module (front_end.py).
//
// What the front end says (protocol.py checks it): hello, wish, ack, budget, probe, scene, page.
// What it hears:
//
//   welcome    title, shape [z,y,x], spacing, box [[x,y,z], [x,y,z]] in world space,
//              anatomical: whether that is a patient's, LPS; dtype, range [low, high],
//              bits_per_voxel, max_error of voxels, isovalue, scene: fields of the scene to show at
//              first, or null; annotations: those to show at first, as in wishes, or null: the
//              scene's; color_map: as in wishes, what colours surfaces at first, or null; levels
//              of detail; field: name, range of the second volume ("volume": the same one), and
//              labels: whether it may have some; or null; steps: names of a series' steps, or null;
//              sources: of each step, or of the volume, path, dataset and index of its file, or
//              null; the field's source, too. The facts are those of the first step, and all steps
//              have one box
//   status     state: starting, ready, failed; device ("host": none), notice (what it computes
//              otherwise than the host, or ""), device_memory (null on the host), memory_bytes,
//              memory_budget, nbytes of the compressed volume
//   histogram  counts of equally wide bins, range, suggested isovalues
//   picture    wish, step, frame, stage: first, pass, sharp, whole, lossless; format, size,
//              samples, ambient, shadow, bounce, camera, isovalue, complete, passes,
//              decoded_blocks, percent, ms, detail; samples: of one whose rays are chosen,
//              before it is finished, the most;
//              rays_cut: of a finished one, how many rays have more hits than are drawn;
//              field_range: of a finished one, the least and the largest value of the field at the
//              hits, or null;
//              reduced: why a finished one has fewer rays than its wish, or null; notice: of a
//              finished one, that the isovalue is outside the volume's values, or ""; and its bytes
//   progress   wish, percent: how far its picture is
//   probe      id, position in world space, value there, field: the second volume's; null: nothing
//   scene      fields of the scene file that was sent, as _core.parse_scene() gives them
//   page       the bytes of an HTML file that shows the scene that was sent, with its volume
//   bounds     wish, within_pixel: the share of the surface that is certainly so near to that of
//              the volume before compression; null: there is no surface. errors_are_stated: that
//              is certain only if the errors are right that the volume's file states
//   error      message, wish or null: of none
//   closed     message, retry: whether to connect again
//
// A wish is numbered; a picture is shown only if no picture of a later wish, and none with a higher
// frame number, was shown before. Event "isowave:shown" tells which one was.

/** @typedef {Record<string, any>} Message */
/**
 * @typedef {{send: (message: Message) => void, close: () => void}} Connection
 * @typedef {{send: (message: Message) => void, wheel: (view: View) => boolean, hash: boolean,
 *    isDark: () => boolean, beside: (receive: (head: Message, data?: BlobPart) => void) =>
 *    Connection, open?: (file: File) => void}} Home where a view is. wheel: whether the wheel is
 *    the view's; beside: another connection to the scene; open: opens a volume that was dropped
 */

const VERSION = 13;
const MIN_WAIT_MS = 15; // between two wishes
const MAX_IN_WAIT_MS = 120; // for a picture of the last wish, before the next one is sent
const MAX_PIXEL_RATIO = 2;
const RATIO_MS = 1000; // between looks at the density of the screen
const WORK_MS = 700; // until the page says how far a picture is
const DARK = "(prefers-color-scheme: dark)";

const isFresher = (a, b) => a.wish > b.wish || (a.wish === b.wish && a.frame > b.frame);
/** A picture's bytes. rgba: not encoded, as the engine in a page gives them. */
const toBitmap = ({ format, size }, data) => createImageBitmap(format === "rgba"
  ? new ImageData(data, ...size) : new Blob([data], { type: `image/${format}` }));

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
    this.root.querySelector("[name=share]").hidden = !home.hash;
    const sheet = new CSSStyleSheet();
    sheet.replaceSync(CSS);
    this.root.adoptedStyleSheets = [sheet];
    host.dataset.lmSuppressShortcuts = "true"; // JupyterLab's, while the focus is in here
    this.find = (selector) => this.root.querySelector(selector);
    this.picture = this.find(".picture");
    this.field = (name) => this.find(`[name=${name}]`);
    this.clips = [...this.root.querySelectorAll(".clip input")];
    /** @type {State} */
    this.state = { surfaces: [makeSurface(NaN)], selected: 0, camera: null, background: null,
      samples: 1, max_error: null, by: "proof", time_budget: null, voxel_pixels: null, ambient: 0,
      clip: WHOLE,
      caps: true, color_map: null, planes: [], lights: null, light: null,
      background_top: null, shadow: null, bounce: 0, slices: [], slice_map: GRAY, labels: [],
      step: 0, annotations: NO_ANNOTATIONS };
    if (home.hash) Object.assign(this.state, readHash(location.hash, this.state));
    this.sides = sidesOf(false);
    this.isNew = !(home.hash && location.hash.length > 1); // shows the server's scene first
    this.history = new History(this);
    this.menus = new Menus(this);
    this.sheet = new Sheet(this);
    this.histogram = new Histogram(this);
    this.tools = new Tools(this);
    this.gestures = new Gestures(this);
    this.cameras = new Cameras(this);
    this.cube = new Cube(this);
    this.overlay = new Overlay(this);
    this.export = new Export(this);
    this.surfaces = new SurfaceList(this);
    this.planes = new PlaneList(this);
    this.quality = new QualityRows(this);
    this.look = new Look(this);
    this.slices = new SliceList(this);
    this.labels = new LabelList(this);
    this.annotations = new AnnotationRows(this);
    this.time = new Timeline(this);
    this.scenes = new SceneFiles(this);
    this.wish = 0;
    this.shown = this.arrived = { wish: -1, frame: -1 };
    this.isAtRest = false; // all pixels of the newest wish are shown
    this.answered = true; // there is a picture of the last wish, or an error
    this.sentAt = -Infinity;
    this.scheduled = this.held = 0;
    this.resetDue = false;
    this.ended = new AbortController();
    this.listen();
    this.showState();
    this.sheet.setStop(this.sheet.isSmall ? 0 : 2);
  }

  // From the scene.

  /** A new connection: what was asked for must be asked for again. */
  connected() {
    this.shown = this.arrived = { wish: this.shown.wish, frame: -1 };
    this.volume = null;
    this.tools.waiting.clear();
    this.note("Starting …", "passing");
    this.home.send({ type: "hello", version: VERSION });
  }

  /**
   * @param {Message} head
   * @param {BlobPart=} data of a picture
   */
  receive(head, data) {
    const takers = { welcome: this.welcome, status: this.showStatus, error: this.showError,
      histogram: this.showHistogram, bounds: this.showBounds, scene: this.scenes.take,
      progress: this.showWork, probe: this.tools.take };
    if (head.type === "picture") return this.showPicture(head, data);
    takers[head.type]?.call(this, head);
  }

  welcome(head) {
    this.volume = head;
    this.sides = sidesOf(head.anatomical);
    this.find(".frame").classList.remove("starting");
    const [z, y, x] = head.shape;
    this.find(".title").textContent = this.find(".title").title = head.title || "Volume";
    this.find(".volume").textContent =
      `${x} × ${y} × ${z} ${head.dtype}, ${toShort(head.bits_per_voxel)} bits per voxel`;
    if (this.home.hash && head.title) document.title = `${head.title} – isowave`;
    for (const part of [this.look, this.labels, this.annotations, this.histogram, this.time,
      this.quality]) part.welcome(head);
    if (this.isNew && head.scene) this.scenes.use(head.scene);
    if (this.isNew && head.annotations) this.state.annotations = head.annotations;
    if (this.isNew && head.color_map) this.state.color_map = head.color_map;
    this.isNew = false;
    if (!Number.isFinite(this.surface.isovalue)) this.surface.isovalue = head.isovalue;
    this.showState();
    this.push();
  }

  showStatus(head) {
    const ready = head.state === "ready";
    this.host.dataset.state = head.state;
    if (head.state === "starting") this.note("Preparing to draw …", "passing");
    else this.clearNote("passing");
    this.list(".device", ready ? {
      Device: head.device,
      ...(head.notice && { Arithmetic: head.notice }),
      Memory: [head.memory_bytes, head.device_memory].filter(Boolean).map(toMiB).join(" of "),
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
      this.time.play(false);
      this.time.came(false);
    }
    // In the units of the field that budgets are given in.
    const text = /budget/.test(head.message) ? head.message.replaceAll(/(\d{6,})( bytes)?/g,
      (_, bytes) => `${Math.ceil(bytes / 2 ** 20).toLocaleString("en")} MiB`) : head.message;
    this.note(text, head.wish === null ? "error" : "drawing");
  }

  async showPicture(head, data) {
    const { connection } = this;
    // Bitmaps may be ready in another order than they came in.
    if (isFresher(head, this.arrived)) {
      this.arrived = head;
      try {
        const bitmap = await toBitmap(head, data);
        if (isFresher(head, this.shown)) this.draw(head, bitmap, data);
        bitmap.close();
      } catch {
        this.note("A picture could not be read.", "drawing");
      }
    }
    if (connection === this.connection) this.home.send({ type: "ack", frame: head.frame });
  }

  /** Shows a picture, by its bytes, until the first one comes. */
  async showStill(data) {
    const bitmap = await createImageBitmap(new Blob([data]));
    const { picture, shown } = this;
    picture.style.objectFit = "contain";
    if (shown.wish < 0) {
      Object.assign(picture, { width: bitmap.width, height: bitmap.height });
      picture.getContext("2d").drawImage(bitmap, 0, 0);
    }
    bitmap.close();
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
    if (!this.state.camera && !this.resetDue) this.takeCamera(head.camera);
    const rest = head.stage === "whole" || head.stage === "lossless";
    this.isAtRest = rest || head.stage === "sharp";
    this.progress(rest ? 100 : head.percent ?? 50);
    if (head.stage === "sharp") this.progress(0);
    this.time.came(rest);
    if (rest) this.list(".facts", factsOf(head, this.state));
    const notes = [head.notice, head.reduced].filter(Boolean);
    if (rest && notes.length) this.note(notes.join(" "), "drawing");
    if (head.stage === "lossless") {
      this.say(`Isovalue ${toText(head.isovalue)}, ${head.complete ? "" : "not "}complete.`);
      this.keepHash();
    }
  }

  /** The camera that shows everything. */
  takeCamera(camera) {
    this.state.camera = this.homeCamera = camera;
    this.showState();
  }

  /** How far the picture is that is wished for. */
  showWork({ wish, percent }) {
    if (wish !== this.wish) return;
    const now = performance.now();
    this.progress(Math.min(percent, 99));
    if (now - this.sentAt < WORK_MS) return;
    const what = this.isAtRest ? "Adding light and detail" : "Drawing";
    this.find(".work").textContent = percent < 100 ? `${what} … ${Math.round(percent)} %`
      : `${what} …`;
    this.find(".work").hidden = false;
  }

  /** How near the surface is to that of the volume before compression. */
  showBounds(head) {
    if (head.wish !== this.wish || head.within_pixel === null) return;
    const elements = boundsElements(head);
    this.find(".facts").append(...elements);
    const [name, value] = elements.map((element) => element.textContent);
    this.find(".certain").textContent = `${name} ${value.split(" ").slice(2).join(" ")}: ${
      value.split(" ").slice(0, 2).join(" ")}`;
  }

  list(selector, facts) {
    this.find(selector).replaceChildren(...Object.entries(facts).flatMap(([name, value]) => {
      const [dt, dd] = [document.createElement("dt"), document.createElement("dd")];
      [dt.textContent, dd.textContent] = [name, value];
      return [dt, dd];
    }));
  }

  showHistogram(head) {
    this.histogram.set(head);
  }

  // To the scene.

  /** Wishes for the state at hand, soon: at most once a frame, and when the last is answered. */
  push() {
    if (this.scheduled || this.held || !this.volume) return;
    this.host.dataset.pending = "";
    this.scheduled = requestAnimationFrame(() => {
      this.scheduled = 0;
      const waited = performance.now() - this.sentAt;
      const left = (this.answered ? MIN_WAIT_MS : this.time.patience) - waited;
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
    delete this.host.dataset.pending;
    this.resetDue = false;
    const { width, height } = this.sizeWished;
    if (!(width >= 1 && height >= 1)) return; // hidden: the observer pushes when it is not
    this.wish += 1;
    this.answered = this.isAtRest = false;
    this.sentAt = performance.now();
    if (!(this.began.wish <= this.wish)) this.began = { wish: this.wish, at: this.sentAt };
    this.host.dataset.wish = this.wish;
    this.progress(0);
    this.find(".certain").textContent = "";
    this.tools.say(null);
    this.home.send(this.wishOf(this.wish, [width, height], this.state));
    this.time.wished();
  }

  /** Width and height of the picture [pixels]. */
  get sizeWished() {
    const { width, height } = this.picture.getBoundingClientRect();
    const ratio = Math.min(devicePixelRatio, MAX_PIXEL_RATIO);
    const pixels = (side) => (side >= 1 ? clamp(Math.round(side * ratio), 1, 8192) : 0);
    return { width: pixels(width), height: pixels(height) };
  }

  /**
   * The message that asks for the picture of a state.
   * @param {number} id
   * @param {[number, number]} size
   * @param {State} state
   * @param {boolean} transparent
   */
  wishOf(id, size, state, transparent = false) {
    const { clip, planes, camera, caps } = state;
    return {
      type: "wish",
      id,
      size,
      step: this.time.step,
      camera,
      background: toRgb(this.backgroundShown()),
      clip: [...clipPlanes(clip, this.volume.box), ...planes],
      caps,
      ...lookOf(state, this.volume.field),
      ...(transparent && { background_top: null }),
      ...wishedSurfaces(state),
      ...wishedQuality(state),
      ...wishedAnnotations(state),
      transparent,
    };
  }

  /** Changes the state, shows it, wishes for it. */
  change(changes) {
    if (this.volume) this.history.note();
    Object.assign(this.state, changes);
    if (changes.camera === null) this.resetDue = true; // pictures before have the camera before
    // A frame keeps an error, or else a time and a detail; what was given last counts.
    if (changes.time_budget) this.state.max_error = null;
    else if (changes.max_error) this.state.time_budget = this.state.voxel_pixels = null;
    else if (changes.voxel_pixels) this.state.max_error = null;
    this.clearNote("error");
    this.showState();
    this.push();
  }

  /** The view that shows everything. */
  reset() {
    this.change({ camera: null });
  }

  /** The selected surface, which the slider moves. */
  get surface() {
    return this.state.surfaces[this.state.selected];
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

  /** A window that was made narrower than high shows as much of the width as before. */
  keepInView() {
    const { width, height } = this.picture.getBoundingClientRect();
    if (!(width >= 1 && height >= 1)) return; // hidden
    const { camera } = this.state;
    const narrow = Math.min(1, width / height);
    if (camera && camera === this.homeCamera) this.state.camera = null; // is fitted anew
    else if (camera && this.narrow) this.state.camera = zoom(camera, this.narrow / narrow);
    this.narrow = narrow;
  }

  /** The unit of the world's lengths; "": it is not known. */
  get unit() {
    return this.state.annotations.units || (this.volume?.anatomical ? "mm" : "");
  }

  backgroundShown() {
    return this.state.background ?? (this.home.isDark() ? "#14171a" : "#ffffff");
  }

  // What the elements show.

  showState() {
    const { state } = this;
    this.clips.forEach((slider, i) => { slider.value = state.clip[i]; });
    this.field("caps").checked = state.caps;
    for (const part of [this.labels, this.surfaces, this.quality, this.look, this.slices,
      this.planes, this.annotations, this.time, this.histogram, this.cube, this.overlay,
      this.history, this.export]) part.show(state);
  }

  /** A menu was opened. */
  opened(name) {
    if (name === "export_menu") this.export.show();
    if (name === "file_menu") this.scenes.showRecent();
  }

  /** Not while somebody types there. */
  set(name, value) {
    const field = this.field(name);
    if (this.root.activeElement !== field) field.value = value;
  }

  /**
   * @param {string} text
   * @param {"passing" | "drawing" | "error" | "silent"} kind what makes it go: the device is ready;
   *    a picture of the newest wish; the next thing that somebody does; the kernel answers. Passing
   *    ones give way to others.
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
    if (percent === 0 || percent === 100) this.find(".work").hidden = true;
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
    this.listenToFields(on);
    this.listenToResolution();
    on(matchMedia(DARK), "change", () => this.change({}));
    if (this.home.hash) {
      on(window, "hashchange", () => this.change(readHash(location.hash, this.state)));
    }
    const observer = new ResizeObserver(() => {
      this.keepInView();
      this.showState();
      this.push();
    });
    observer.observe(this.picture);
    on(signal, "abort", () => observer.disconnect());
  }

  /** A window that comes to a screen of another density wants other pixels. */
  listenToResolution() {
    const { signal } = this.ended;
    let ratio = devicePixelRatio;
    const check = () => {
      if (devicePixelRatio === ratio) return;
      ratio = devicePixelRatio;
      this.showState();
      this.push();
      listen();
    };
    const listen = () => matchMedia(`(resolution: ${ratio}dppx)`)
      .addEventListener("change", check, { once: true, signal });
    listen();
    const timer = setInterval(check, RATIO_MS); // not all browsers tell of it each time
    signal.addEventListener("abort", () => clearInterval(timer));
  }

  listenToFields(on) {
    this.clips.forEach((slider, i) => on(slider, "input", () =>
      this.change({ clip: moveClip(this.state.clip, i, Number(slider.value)) })));
    on(this.field("caps"), "change", (e) => this.change({ caps: e.target.checked }));
    for (const part of [this.history, this.quality, this.look, this.slices, this.labels,
      this.annotations, this.time, this.scenes, this.surfaces, this.planes, this.histogram,
      this.menus, this.sheet, this.tools, this.gestures, this.cameras, this.cube, this.overlay,
      this.export]) part.listen(on);
    on(this.find(".budget"), "submit", (e) => this.sendBudget(e));
    on(this.field("budget"), "change", (e) => this.sendBudget(e));
    on(this.field("share"), "click", () => this.share());
  }

  sendBudget(event) {
    event.preventDefault();
    const field = this.field("budget");
    const bytes = field.value ? Math.round(Number(field.value) * 2 ** 20) : null;
    if (!field.validity.valid || bytes === this.budgetSent) return;
    this.budgetSent = bytes;
    this.home.send({ type: "budget", bytes });
  }

  /** The page's address shows what it shows now. */
  async share() {
    this.keepHash();
    if (!await this.copyText(location.href, "share")) {
      this.note("The address of this page shows the same view: copy it from there.", "error");
    }
  }

  /** @returns {Promise<boolean>} whether the text is on the clipboard; the button says so */
  async copyText(text, name) {
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      return false; // no access
    }
    const button = this.field(name);
    const before = button.dataset.text ?? button.textContent;
    Object.assign(button.dataset, { text: before });
    button.textContent = "Copied";
    this.say("Copied");
    setTimeout(() => { button.textContent = before; }, 1500);
    return true;
  }

  close() {
    this.ended.abort();
    cancelAnimationFrame(this.scheduled);
    clearTimeout(this.held);
  }
}
