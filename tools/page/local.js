// local.js -- a page without a server: the engine (engine.cpp) in workers, behind a view. It says
// and hears what the server does (view.js, protocol.py). The last part of an ES module
// (make_page.py).
//
// From a wish come a picture of a quarter of width and height, a ray a pixel if the wish has more,
// and the whole picture. Workers draw bands of rows, each with an engine of its own, since a page
// from a file has no memory that workers share. A newer wish ends a picture after its bands, but
// for the first, which is small.

const QUARTER = 4;
const BAND_MS = 40; // that a worker takes for a band, about
const MOST_WORKERS = 8;
const MOST_BYTES = 2e9; // of all workers' engines, about
const ENGINE_BYTES = 192e6; // of one, beside what the volume takes
/** What a page's engine does not have: elements of the panel and the menus. */
const NOT_HERE = ["[name=max_error]", "[name=by]", "[name=time_budget]", ".levels",
  "[name=save_page]", ".budget"];
const OF_FIELDS = ["[name=colour_by][value=field]"]; // if the scene has no second volume

/** Bytes of base64 text, piece by piece. */
function fromBase64(text) {
  const clean = text.trim();
  const bytes = new Uint8Array(Math.floor(clean.length / 4) * 3);
  let count = 0;
  for (let begin = 0; begin < clean.length; begin += 1 << 20) {
    const piece = atob(clean.slice(begin, begin + (1 << 20)));
    for (let i = 0; i < piece.length; ++i) bytes[count++] = piece.charCodeAt(i);
  }
  return bytes.subarray(0, count);
}

const unzip = (bytes) => new Response(
  new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();

/** Workers, each with an engine. */
class Crew {
  /**
   * @param {WebAssembly.Module} module
   * @param {string} code of a worker
   */
  constructor(module, code) {
    this.module = module;
    this.url = URL.createObjectURL(new Blob([code], { type: "text/javascript" }));
    /** @type {Worker[]} */
    this.workers = [];
    /** @type {Worker[]} those that have the volume */
    this.ready = [];
    this.answers = new Map();
    this.asked = 0;
    this.remote = null; // volume that is not in the page
  }

  /** One more, which has no volume yet. */
  async add() {
    const worker = new Worker(this.url);
    worker.onmessage = ({ data: { id, ...answer } }) => {
      const { resolve, reject } = this.answers.get(id);
      this.answers.delete(id);
      if (answer.error) reject(new Error(answer.error));
      else resolve(answer);
    };
    worker.onerror = ({ message }) => this.end(worker, message);
    this.workers.push(worker);
    await this.ask(worker, { what: "start", module: this.module });
    return worker;
  }

  end(worker, why) {
    worker.terminate();
    this.workers = this.workers.filter((each) => each !== worker);
    this.ready = this.ready.filter((each) => each !== worker);
    for (const [id, answer] of this.answers) {
      if (answer.worker !== worker) continue;
      this.answers.delete(id);
      answer.reject(new Error(why));
    }
  }

  /** @returns {Promise<Message>} the engine's answer */
  ask(worker, request, given = []) {
    const id = ++this.asked;
    return new Promise((resolve, reject) => {
      this.answers.set(id, { resolve, reject, worker });
      worker.postMessage({ id, ...request }, given);
    });
  }

  /**
   * As ask(). What the engine lacks of a volume beside the page, it gets.
   * @returns {Promise<?Message>} null: isOver() says that no one waits any more
   */
  async work(worker, request, isOver = () => false) {
    for (let took = 0; ;) {
      const answer = await this.ask(worker, request);
      took += answer.took;
      if (!answer.missing) return { ...answer, took };
      if (isOver()) return null;
      const bytes = await this.remote.get(answer.missing);
      if (isOver()) return null;
      await this.ask(worker, { what: "supply", parts: answer.missing, bytes }, [bytes.buffer]);
    }
  }

  /** What the first worker answers. */
  askFirst(request) {
    return this.work(this.workers[0], request);
  }

  /** Opens a volume: in one worker, which says what it is; the others get it meanwhile.
   * @param {?RemoteVolume} remote the volume; bytes are the head of its file
   * @param {?Uint8Array} field the .zfp file of a second volume
   * @returns {Promise<Message>} facts of the volume, as in welcome */
  async open(name, bytes, remote = null, field = null) {
    if (this.workers.length === 0) await this.add();
    const keep = !remote && !/\.zfp$/i.test(name);
    const chunks = remote?.bytes; // of the whole file
    const { data, ...facts } = await this.askFirst(
      { what: "open", name, bytes, keep, chunks, field });
    this.remote = remote;
    for (const worker of this.workers.slice(1)) this.end(worker, "The volume is another one.");
    this.ready = [...this.workers];
    const file = { what: "open", name: "volume.zfp", bytes: data ?? bytes, keep: false, chunks,
      field };
    const each = ENGINE_BYTES + facts.memory
      + 2 * ((remote ? 0 : facts.nbytes) + (field?.length ?? 0));
    this.count = clamp(Math.floor(MOST_BYTES / each), 1,
      Math.min(navigator.hardwareConcurrency || 2, MOST_WORKERS));
    for (let i = 1; i < this.count; ++i) this.join(file);
    return facts;
  }

  /** Counts of values, and isovalues that are worth a look. */
  histogram() {
    return this.remote?.values ?? this.askFirst({ what: "histogram" });
  }

  /** One more worker with the volume; if it has no memory for that, the others draw all. */
  async join(file) {
    const worker = await this.add();
    try {
      await this.ask(worker, file);
      if (this.workers.includes(worker)) this.ready.push(worker);
    } catch ({ message }) {
      this.end(worker, message);
    }
  }
}

/** A wish as a scene file. */
function sceneOf(wish) {
  const { surfaces, isovalue, color, camera, color_map: map, slice_map: slices } = wish;
  return {
    isowave_scene: 1,
    ...(camera && { camera: sceneCamera(camera) }),
    surfaces: surfaces.length ? surfaces : [{ isovalue, color, opacity: 1 }],
    clip: wish.clip,
    caps: wish.caps,
    slices: wish.slices,
    slice_map: slices.colors,
    ...(slices.range && { slice_low: slices.range[0], slice_high: slices.range[1] }),
    background: wish.background,
    ...(wish.background_top && { background_top: wish.background_top }),
    transparent: wish.transparent,
    ...(map && { color_map: map.colors, color_axis: map.axis }),
    ...(map?.by === "depth" && { color_by_depth: true }),
    ...(isByField(map) && { field: "volume", color_by_field: true,
      color_caps_alone: map.by === "caps", color_by_label: map.by === "labels" }),
    ...(map?.range && { color_low: map.range[0], color_high: map.range[1] }),
    ...wish.lights,
    ...(wish.light && { light_direction: wish.light }),
    ...(wish.shadow && { shadow_rays: wish.shadow.rays, light_angle: wish.shadow.angle }),
    ...(wish.bounce && { bounce_rays: wish.bounce }),
    ...(wish.annotations && { annotations: sceneAnnotations(wish.annotations) }),
  };
}

/** A scene as the engine writes it, with the fields that have their defaults: see readScene(). */
function fieldsOf(scene) {
  const toParts = (color) => (typeof color === "string" ? toRgb(color) : color);
  const hasLights = LIGHTS.some((name) => name in scene);
  const weights = LIGHTS.map((name, i) => [name, WEIGHTS[i]]);
  return {
    ...(hasLights && Object.fromEntries(weights)), ...scene,
    clip: (scene.clip ?? []).map((plane) => ({ offset: 0, ...plane })),
    slices: (scene.slices ?? []).map((slice) =>
      ({ offset: 0, opacity: 1, clipped: true, ...slice })),
    surfaces: scene.surfaces.map((surface) =>
      ({ isovalue: 0, opacity: 1, ...surface, color: toParts(surface.color) })),
    background: toParts(scene.background ?? [1, 1, 1]),
    background_top: scene.background_top && toParts(scene.background_top),
  };
}

/** The stages of a wish's picture, the worst first. coarse: begins with levels of detail. */
function stagesOf(wish, coarse) {
  const quick = { samples: 1, ambient: 0, shadow: null, bounce: 0,
    ...(coarse && { voxel_pixels: 1 }) };
  const small = wish.size.map((side) => Math.ceil(side / QUARTER));
  const hasMore = wish.samples > 1 || wish.ambient || wish.shadow || wish.bounce;
  return [
    { ...wish, ...quick, size: small, stage: "first" },
    ...(hasMore || coarse ? [{ ...wish, ...quick, stage: "sharp" }] : []),
    { ...wish, stage: "lossless" },
  ];
}

/** Whether rows depend on others: light that bounces is filtered; colours by values begin and end
 * at those that are seen. */
const isInBands = ({ bounce, color_map: map, surfaces }) =>
  !bounce && !(isByField(map) && map.by !== "labels" && !map.range && !surfaces.length);

/** What a server would be: draws the wishes of a view. */
class LocalScene {
  /**
   * @param {Crew} crew
   * @param {(head: Message, data?: BlobPart) => void} hear
   */
  constructor(crew, hear) {
    Object.assign(this, { crew, hear, facts: null, first: null, title: "" });
    this.frames = 0;
    this.next = null; // wish that is to be drawn
    this.last = null; // wish that was drawn last
    this.isDrawing = false;
    this.histogram = null;
    this.msPerRow = {}; // by stage
  }

  /** @param {?Message} first fields of the scene that is shown at first */
  use(facts, title, first) {
    Object.assign(this, { facts, title, first, histogram: null, last: null, msPerRow: {} });
  }

  get welcome() {
    const { isovalue } = this.first?.surfaces[0] ?? { isovalue: this.facts.isovalue };
    const { second } = this.facts;
    const hasField = second || this.first?.field === "volume" || this.first?.color_by_label;
    const { range, dtype } = second ?? this.facts;
    const field = hasField ? { name: second ? this.first.field : "volume", range,
      labels: /int/.test(dtype) } : null;
    return { ...this.facts, type: "welcome", version: VERSION, title: this.title, isovalue,
      scene: this.first && this.fitted(this.first), annotations: null, field, steps: null };
  }

  /** A scene whose camera shows as much of the width in pictures that are narrower than high. */
  fitted(scene) {
    const { camera } = scene;
    return camera ? { ...scene, camera: zoom(camera, 1 / this.narrow()) }
      : scene;
  }

  get status() {
    const { count } = this.crew;
    return { type: "status", state: "ready", notice: "", device_memory: null, memory_budget: null,
      device: `this page, ${count} worker${count > 1 ? "s" : ""}`,
      memory_bytes: this.facts.memory * count, nbytes: this.facts.nbytes };
  }

  send(message) {
    const acts = { hello: this.greet, wish: this.wish, probe: this.probe, scene: this.read };
    acts[message.type]?.call(this, message);
  }

  greet() {
    this.hear(this.welcome);
    this.hear(this.status);
    if (this.histogram) this.hear(this.histogram);
  }

  async wish(wish) {
    this.next = wish;
    if (this.isDrawing) return;
    this.isDrawing = true;
    while (this.next) {
      const now = this.next;
      this.next = null;
      try {
        await this.drawWish(now);
      } catch ({ message }) {
        this.hear({ type: "error", wish: now.id, message });
      }
    }
    this.isDrawing = false;
    if (!this.histogram) this.showHistogram();
  }

  async drawWish(wish) {
    const begin = performance.now();
    const seen = wish.camera ? wish : { ...wish, camera: await this.camera(wish) };
    this.last = seen;
    for (const stage of stagesOf(seen, this.crew.remote && this.facts.levels > 1)) {
      const picture = await this.drawStage(stage);
      if (!picture) return; // there is a newer wish
      const { bounce, ambient, shadow } = stage;
      this.hear({ type: "picture", wish: wish.id, step: 0, frame: ++this.frames,
        stage: stage.stage, format: "rgba", size: picture.size, samples: stage.samples, bounce,
        ambient, shadow: shadow?.rays ?? 0, camera: seen.camera, isovalue: wish.isovalue,
        complete: stage.stage === "lossless", detail: null, reduced: null, percent: 100,
        ms: performance.now() - begin, passes: 1, ...picture.facts }, picture.pixels);
    }
  }

  async camera({ size, ...wish }) {
    return (await this.crew.askFirst({ what: "camera", scene: sceneOf(wish), size })).camera;
  }

  /** @returns {Promise<?{pixels: Uint8ClampedArray, facts: Message}>} null: a newer wish came */
  async drawStage(stage) {
    const [width, height] = stage.size;
    const workers = [...this.crew.ready];
    const { size: annotated } = this.last; // in smaller pictures, texts could not be read
    let pixels = new Uint8ClampedArray(4 * width * height);
    let groups = [];
    const facts = { decoded_blocks: 0, rays_cut: 0, notice: "", field_range: null };
    const request = { ...this.requestOf(stage), annotated,
      voxel_pixels: stage.voxel_pixels ?? 0 };
    const band = this.bandOf(stage, workers.length);
    let row = 0;
    let failure = null;
    const isOver = () => failure || (this.next && stage.stage !== "first");
    const draw = async (worker) => {
      while (row < height && !isOver()) {
        const rows = [row, Math.min(height, row + band)];
        [, row] = rows;
        const answer = await this.crew.work(worker, { ...request, rows }, isOver);
        if (!answer) return;
        const { data, took, ...of } = answer;
        pixels.set(data, 4 * width * rows[0]);
        groups = JSON.parse(of.annotations);
        facts.decoded_blocks += of.decoded_blocks;
        facts.rays_cut += of.rays_cut;
        facts.notice = of.notice;
        facts.field_range = of.field_range ?? null;
        const { stage: name } = stage;
        this.msPerRow[name] = Math.max(took / (rows[1] - rows[0]), (this.msPerRow[name] ?? 0) / 2);
        this.hear({ type: "progress", wish: stage.id, percent: 100 * rows[1] / height });
      }
    };
    await Promise.all(workers.map((worker) => draw(worker).catch((error) => { failure = error; })));
    if (failure) throw failure;
    if (this.next && stage.stage !== "first") return null;
    if (groups.length) {
      if (width !== annotated[0]) pixels = resized(pixels, stage.size, annotated);
      annotate(pixels, annotated[0], groups);
    }
    return { pixels, size: groups.length ? annotated : stage.size, facts };
  }

  /** What the engine is asked for a picture. */
  requestOf({ size, samples, ambient, annotations, ...wish }) {
    const titled = annotations && { ...annotations, title: annotations.title || this.title };
    return { what: "draw", scene: sceneOf({ ...wish, annotations: titled }), size, samples,
      ambient };
  }

  /** Rows of a band. */
  bandOf(stage, count) {
    const [, height] = stage.size;
    if (!isInBands(stage)) return height;
    const share = Math.ceil(height / count / 2);
    if (this.crew.remote) return share; // rays that wait for parts wait together
    const before = this.msPerRow[stage.stage] ?? this.msPerRow.first * QUARTER;
    return before ? clamp(Math.round(BAND_MS / before), 1, share) : share;
  }

  /** What is seen at a place of the last picture. */
  async probe({ id, at }) {
    const nothing = { type: "probe", id, position: null, value: null, field: null };
    try {
      const { size, ...wish } = this.last;
      const { position, value, field } = await this.crew.askFirst({ what: "probe",
        scene: sceneOf(wish), size, at });
      this.hear({ ...nothing, position, value, field });
    } catch {
      this.hear(nothing); // pictures tell of it
    }
  }

  async read({ text }) {
    try {
      const { fields } = await this.crew.askFirst({ what: "scene", text });
      this.hear({ type: "scene", fields: fieldsOf(fields) });
    } catch ({ message }) {
      this.hear({ type: "error", wish: null, message });
    }
  }

  /** When the first picture is there, which matters more. */
  async showHistogram() {
    this.histogram = { type: "histogram" };
    const { counts, range, suggested } = await this.crew.histogram();
    this.histogram = { type: "histogram", counts, range, suggested };
    this.hear(this.histogram);
  }

  /** Another connection, for a picture as a file: one worker draws it. */
  beside(hear) {
    let isOver = false;
    const say = (head, data) => !isOver && hear(head, data);
    const draw = async (wish) => {
      try {
        const { size, transparent, camera } = wish;
        const { data, annotations } = await this.crew.askFirst(
          { ...this.requestOf(wish), annotated: size });
        const pixels = new Uint8ClampedArray(data.buffer);
        annotate(pixels, size[0], JSON.parse(annotations));
        say({ type: "picture", wish: wish.id, frame: 1, stage: "lossless", format: "png" },
          await toPng(pixels, size, transparent, writeCamera(camera, ...size)));
      } catch ({ message }) {
        say({ type: "error", wish: wish.id, message });
      }
    };
    return {
      send: (message) => {
        if (message.type === "hello") setTimeout(() => say(this.welcome));
        if (message.type === "wish") draw(message);
      },
      close: () => { isOver = true; },
    };
  }
}

/** Leaves out what the engine does not do. */
function hideRest(view, local) {
  const left = local.welcome.field ? NOT_HERE : [...NOT_HERE, ...OF_FIELDS];
  for (const selector of left) {
    for (const element of view.root.querySelectorAll(selector)) {
      (element.closest("label") ?? element).hidden = true;
    }
  }
  view.find(".file .hint").textContent = "Scenes (.json) and volumes (.zfp, .nrrd, .mha, .nii, "
    + "NAME_XxYxZ_TYPE.raw) can be dropped on the picture. Nothing leaves this computer.";
}

/** A file that was dropped: another volume. */
async function openDropped(view, local, file) {
  view.note(`Opening ${file.name} …`, "passing");
  try {
    const facts = await local.crew.open(file.name, await file.arrayBuffer());
    const [suggested] = (await local.crew.histogram()).suggested;
    local.use({ ...facts, isovalue: suggested ?? (facts.range[0] + facts.range[1]) / 2 },
      file.name, null);
    Object.assign(view.state, { surfaces: [makeSurface(NaN)], selected: 0, camera: null,
      planes: [], clip: WHOLE, slices: [], labels: [], color_map: null });
    view.homeCamera = null;
    view.resetDue = true;
    view.connected();
  } catch (error) {
    view.note(error.message, "error");
  }
}

/** The page: a poster, until the engine has the volume. */
async function startPage() {
  const find = (id) => document.getElementById(id);
  const say = (text) => { find("line").textContent = text; };
  const missing = [["WebAssembly", globalThis.WebAssembly], ["workers", globalThis.Worker],
    ["DecompressionStream", globalThis.DecompressionStream]].find(([, has]) => !has);
  if (missing) return say(`This browser has no ${missing[0]}: only a picture is shown.`);
  say("Opening the volume …");
  const text = (id) => find(id).textContent;
  const { title } = document;
  let crew;
  try {
    const module = await fitted(await unzip(fromBase64(text("module"))));
    crew = new Crew(await WebAssembly.compile(module), text("code"));
  } catch (error) {
    return say(`The engine of this page does not start: ${error.message}`);
  }
  const of = text("volume").trim();
  const field = text("field").trim();
  try {
    const facts = of.startsWith("{") ? await openBeside(crew, JSON.parse(of))
      : await crew.open("volume.zfp", fromBase64(of), null, field ? fromBase64(field) : null);
    const { fields } = await crew.askFirst({ what: "scene", text: text("scene") });
    showView(crew, facts, title, fieldsOf(fields));
  } catch (error) {
    say(`The volume of this page cannot be opened: ${error.message}`);
  }
}

/** Opens a volume that is a file beside the page. */
async function openBeside(crew, about) {
  if (location.protocol === "file:") {
    throw new Error("it is read from a server. Put the page's folder on one.");
  }
  const remote = new RemoteVolume(about);
  const facts = await crew.open("volume.chunks", await remote.head(), remote);
  return { ...facts, range: remote.values.range, nbytes: remote.bytes };
}

function showView(crew, facts, title, scene) {
  const host = document.body.appendChild(document.createElement("main"));
  host.id = "view";
  let view = null;
  const local = new LocalScene(crew, (head, data) => view.receive(head, data));
  local.use(facts, title, scene);
  local.narrow = () => {
    const { width, height } = view.picture.getBoundingClientRect();
    return width >= 1 && height >= 1 ? Math.min(1, width / height) : 1;
  };
  view = new View(host, {
    send: (message) => local.send(message), wheel: () => true, hash: true,
    isDark: () => matchMedia(DARK).matches,
    beside: (hear) => local.beside(hear), open: (file) => openDropped(view, local, file),
  });
  hideRest(view, local);
  const poster = document.getElementById("poster");
  const [, picture] = poster.querySelector("img").src.split(",");
  view.showStill(fromBase64(picture));
  poster.remove();
  for (const id of ["volume", "field"]) document.getElementById(id).remove(); // engines have them
  view.connected();
}

startPage();
