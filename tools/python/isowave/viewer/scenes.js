// scenes.js -- scene files in the page. A part of an ES module (front_end.py).

const MAX_MESSAGE_BYTES = 8192; // as the server has it

const toHex = (rgb) => `#${rgb.map((part) =>
  Math.round(255 * clamp(part, 0, 1)).toString(16).padStart(2, "0")).join("")}`;

/** @typedef {{path: string, dataset: string, index: string}} Source of a volume, as in welcome */

/** Fields of a scene that say where a volume came from. prefix: volume or field */
function partsOf(name, source) {
  if (!source?.path) return {};
  const prefix = name === "volume" ? "" : "field_";
  return { [name]: source.path, ...(source.dataset && { [`${prefix}dataset`]: source.dataset }),
    ...(source.index && { [`${prefix}index`]: source.index }) };
}

/**
 * The scene file of what a view shows.
 * @param {State} state
 * @param {string} background "#rrggbb", as it is shown
 * @param {{box: [Vec, Vec], field: ?{name: string, labels: boolean, source: ?Source},
 *    sources: ?Source[]}} volume as in welcome
 * @returns {string} JSON, as isowave/scene.hpp describes it
 */
export function writeScene(state, background, { box, field, sources }) {
  const { camera, caps } = state;
  const { color_map: map, lights, light, shadow, bounce } = lookOf(state, field);
  const isOwn = map?.by === "labels" && !field?.labels; // those that are drawn
  const ofField = isOwn || field?.name === "volume" ? { path: "volume" }
    : field?.source ?? { path: field?.name };
  return JSON.stringify({
    isowave_scene: 1,
    ...partsOf("volume", sources?.[sources.length > 1 ? state.step : 0]),
    ...(isByField(map) && partsOf("field", ofField)),
    ...(camera && { camera: sceneCamera(camera) }),
    surfaces: drawnSurfaces(state).map(({ labels, isovalue, color, opacity }) =>
      ({ ...(labels ? { labels } : { isovalue }), color, opacity })),
    clip: [...clipPlanes(state.clip, box), ...state.planes],
    caps,
    ...writeSceneSlices(state),
    background,
    ...(state.background_top && { background_top: state.background_top }),
    ...(map && { color_map: map.colors, color_axis: map.axis }),
    ...(map?.by === "depth" && { color_by_depth: true }),
    ...(isByField(map) && { color_by_field: true, color_caps_alone: map.by === "caps",
      ...(map.by === "labels" && { color_by_label: true }) }),
    ...(map?.range && { color_low: map.range[0], color_high: map.range[1] }),
    ...lights,
    ...(light && { light_direction: light }),
    ...(shadow && { shadow_rays: shadow.rays, light_angle: shadow.angle }),
    ...(bounce && { bounce_rays: bounce }),
    ...writeSceneAnnotations(state),
  }, null, 1);
}

/**
 * A scene as a view shows it.
 * @param {Record<string, any>} fields as `isowave._core.parse_scene()` gives them; those that are
 *    null or not there have their defaults
 * @param {?{labels: boolean}} field the server's second volume, which comes in place of theirs
 * @param {boolean} hasLabels whether the volume may have labels
 * @param {?[Vec, Vec]} box corners of the volume's box: planes of the sliders go back to them
 * @returns {Partial<State>}
 * @throws {Error} that says what this page cannot show
 */
export function readScene(fields, field, hasLabels, box = null) {
  const { camera, color_map: colors, color_axis: axis = AXES.z, color_low: low } = fields;
  const ofLabels = fields.surfaces.filter(({ labels }) => labels?.length);
  const isOwn = fields.color_by_label && ["volume", "", null, undefined].includes(fields.field);
  if (fields.color_by_field && !field && !(isOwn && ofLabels.length)) {
    throw new Error("This page has no second volume to colour by: isowave view --color-by FILE.");
  }
  if (fields.color_by_label && !field?.labels && !(isOwn && ofLabels.length)) {
    throw new Error("The second volume has no labels to colour by.");
  }
  if (fields.surfaces.some(({ clipped }) => clipped === false)) {
    throw new Error('This page cuts all surfaces: leave out "clipped".');
  }
  if (fields.surfaces.some(({ mapped }) => mapped === false)) {
    throw new Error('This page gives all surfaces the map\'s colours: leave out "mapped".');
  }
  if (fields.color_table?.length) throw new Error("This page shows no tables of colours.");
  if (typeof low === "number" && !(Math.max(Math.abs(low), Math.abs(fields.color_high)) <= 1e18)) {
    throw new Error("This page shows colours of values up to 1e18.");
  }
  if (fields.clip.some(({ normal, offset }) => !(Math.abs(offset) / length(normal) <= 1e18))) {
    throw new Error("This page shows clipping planes up to 1e18 from the origin.");
  }
  const { clip, planes } = box ? slidersOf(fields.clip, box) : { clip: WHOLE, planes: fields.clip };
  if (planes.length > MAX_PLANES) {
    throw new Error(`This page shows up to ${MAX_PLANES} clipping planes of a scene.`);
  }
  const view = camera && { up: [0, 1, 0], fovy_deg: 60, ...camera };
  if (view?.fovy_degrees) view.fovy_deg = view.fovy_degrees;
  if (ofLabels.length && !hasLabels) {
    throw new Error(`The volume has no labels, which are integers from 0 to ${MAX_LABEL}.`);
  }
  return {
    camera: view ? checkCamera(view) : null,
    labels: readSceneLabels(ofLabels),
    ...(!ofLabels.length && { selected: 0,
      surfaces: fields.surfaces.map(({ isovalue, color, opacity }) => makeSurface(
        isovalue, toHex(color), Math.max(opacity, LEAST_OPACITY))) }),
    clip,
    planes: planes.map(({ normal, offset }) => (
      { normal: unit(normal), offset: offset / length(normal) })),
    caps: fields.caps ?? true,
    ...readSceneSlices(fields),
    ...readSceneAnnotations(fields),
    background: fields.background ? toHex(fields.background) : null,
    background_top: fields.background_top ? toHex(fields.background_top) : null,
    color_map: colors ? { colors, axis: unit(axis),
      by: !fields.color_by_field ? (fields.color_by_depth ? "depth" : "axis")
        : fields.color_by_label ? "labels" : fields.color_caps_alone ? "caps" : "field",
      range: typeof low === "number" ? [low, fields.color_high] : null } : null,
    light: fields.light_direction ? unit(fields.light_direction) : null,
    shadow: fields.light_direction && fields.shadow_rays > 0
      ? { rays: Math.min(fields.shadow_rays, 255),
        angle: clamp(fields.light_angle ?? LIGHT_ANGLE, 0.01, 45) } : null,
    bounce: Math.min(fields.bounce_rays ?? 0, 255),
    lights: LIGHTS.every((name) => typeof fields[name] === "number")
      && LIGHTS.some((name, i) => fields[name] !== Math.fround(WEIGHTS[i]))
      ? Object.fromEntries(LIGHTS.map((name) => [name, clamp(fields[name], 0, 10)])) : null,
  };
}

/** Has the browser save a file. */
function saveAs(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

const RECENT = "isowave.scenes"; // of the browser's storage
const MOST_RECENT = 5; // scenes

/** Scenes that were opened or saved. @returns {{name: string, text: string}[]} */
function recentScenes() {
  try {
    const list = JSON.parse(localStorage.getItem(RECENT));
    return list.filter(({ name, text }) => typeof name === "string" && typeof text === "string");
  } catch {
    return []; // there are none, or the page has no storage
  }
}

/** Scene files: opened, dropped, saved, recent ones. */
class SceneFiles {
  /** @param {View} view whose state they save and change */
  constructor(view) {
    this.view = view;
    this.take = ({ fields }) => this.use(fields);
  }

  listen(on) {
    const { view } = this;
    on(view.field("save_scene"), "click", () => this.save());
    on(view.field("open_scene"), "click", () => view.field("scene_file").click());
    on(view.field("scene_file"), "change", ({ target }) => {
      this.open(target.files[0]);
      target.value = ""; // the same file can be opened again
    });
    const stage = view.find(".stage");
    on(stage, "dragover", (e) => {
      e.preventDefault();
      stage.classList.add("drops");
    });
    on(stage, "dragleave", () => stage.classList.remove("drops"));
    on(stage, "drop", (e) => {
      e.preventDefault();
      stage.classList.remove("drops");
      this.open(e.dataTransfer.files[0]);
    });
    on(view.find(".recent"), "click", ({ target }) => {
      const scene = recentScenes()[target.dataset.index];
      if (scene) this.send(scene.name, scene.text);
    });
  }

  keep(name, text) {
    const others = recentScenes().filter((scene) => scene.name !== name);
    try {
      localStorage.setItem(RECENT,
        JSON.stringify([{ name, text }, ...others].slice(0, MOST_RECENT)));
    } catch {
      // The page has no storage.
    }
  }

  /** The list of recent scenes, as it is now. */
  showRecent() {
    const scenes = recentScenes();
    this.view.find(".recent").hidden = scenes.length === 0;
    this.view.find(".recent ul").replaceChildren(...scenes.map(({ name }, i) => {
      const [row, button] = [document.createElement("li"), document.createElement("button")];
      Object.assign(button, { type: "button", textContent: name });
      button.dataset.index = i;
      row.append(button);
      return row;
    }));
  }

  save() {
    const { state, volume } = this.view;
    if (!volume) return;
    const text = writeScene(state, this.view.backgroundShown(), volume);
    saveAs(new Blob([text], { type: "application/json" }), "scene.json");
    this.keep(`${volume.title || "Volume"}, ${new Date().toLocaleString()}`, text);
  }

  /** @param {File=} file */
  async open(file) {
    if (!file) return;
    if (!/\.json$/i.test(file.name)) {
      if (this.view.home.open) return this.view.home.open(file);
      this.view.note(`${file.name} is no scene (.json). Volumes are opened by the command: `
        + "isowave view FILE.", "error");
      return;
    }
    this.send(file.name, await file.slice(0, MAX_MESSAGE_BYTES).text());
  }

  /** The server reads the text: there is one reader of scenes. */
  send(name, text) {
    const message = { type: "scene", text };
    const { length: bytes } = new TextEncoder().encode(JSON.stringify(message));
    if (bytes > MAX_MESSAGE_BYTES) {
      this.view.note(`${name} is too large for a scene of this page.`, "error");
      return;
    }
    this.sent = { name, text };
    this.view.home.send(message);
  }

  /** Shows the scene of these fields. */
  use(fields) {
    try {
      const { volume, labels } = this.view;
      this.view.history.hold(false); // undo gives the state before back
      this.view.change(readScene(fields, volume?.field, labels.isUseful, volume?.box));
      if (this.sent) this.keep(this.sent.name, this.sent.text);
      this.sent = null;
    } catch (error) {
      this.view.note(error.message, "error");
    }
  }
}
