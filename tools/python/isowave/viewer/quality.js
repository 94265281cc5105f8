// quality.js -- how good pictures are: their error, rays, and time; their rows in the panel. A part
// of an ES module (front_end.py).

const AMBIENT = [8, 16, 32, 64]; // rays of a hit that one can choose
const SAMPLES = [1, 2, 3, 4, 8]; // rays of a pixel along each axis that one can choose
const MOST_SAMPLES = 4; // the same, if the renderer chooses them and the person chose only 1
/** How errors are judged, with their units and limits, as protocol.py has them. */
const ERRORS = {
  proof: { unit: "px", limits: [0.001, 1000] },
  sample: { unit: "px", limits: [0.001, 1000] },
  picture: { unit: "FLIP", limits: [1e-6, 1] },
};

/** What a press of a look's name gives: the quality of a picture at rest. */
const PRESETS = { draft: { samples: 1, ambient: 0 }, good: { samples: 2, ambient: 0 },
  paper: { samples: 2, ambient: 16 } };
const PRESET_ROWS = segments("preset", "Look", { draft: "Draft", good: "Good", paper: "Paper" });

/** HTML of the panel's rows. */
const QUALITY_ROWS = `
    <label title="How far the surface may be off, on the screen">Accurate to
      <span class="unit"><input name="max_error" type="number" step="any"
      placeholder="none"> <span class="of_error"></span></span></label>
    <label title="The surface, by proof or by a sample; or the whole picture, as an eye sees it">
      Judged by <select name="by">${
  Object.keys(ERRORS).map((by) => `<option>${by}</option>`).join("")}</select></label>
    <p class="hint of_picture" hidden>FLIP is the mean difference that an eye sees between this
      picture and one of 64 rays a pixel at full detail: 0 is none, 1 the most. One ray a pixel
      often has 0.01. The renderer chooses rays and levels of detail.</p>
    <label><span class="of_samples"></span> <select name="samples">${
  SAMPLES.map((n) => `<option value="${n}">${n * n}</option>`).join("")}</select></label>
    <label title="Light from all sides: hollows are darker. More rays, less noise">Soft shade
      <select name="ambient"><option value="0">none</option>${
  AMBIENT.map((n) => `<option value="${n}">${n} rays</option>`).join("")
}</select></label>
    <div class="levels">
    <label title="Coarser levels of detail are drawn where their voxels lie no further apart on the
screen: that is faster">Voxels up to
      <span class="unit"><input name="voxel_pixels" type="number" min="0.01" max="1000" step="any"
      placeholder="all"> px</span></label>
    <p class="hint of_levels" hidden>This volume has one level of detail. Start with
      <code>isowave view --levels all FILE</code> for coarser ones.</p>
    </div>
    <label title="The best picture within this time while you move; it is finished at rest">Time
      per picture
      <span class="unit"><input name="time_budget" type="number"
      min="1" max="10000" step="any"
      placeholder="none"> ms</span></label>`;

/** @returns {boolean} whether the renderer chooses rays, to keep an error of the picture */
const choosesRays = (state) =>
  isPlain(state) && state.by === "picture" && state.max_error !== null;

/** @returns {boolean} whether an error is kept: of a picture, by one surface alone */
const keepsError = (state) =>
  isPlain(state) || (state.by !== "picture" && !drawsLabels(state));

/** A State as a wish's quality. */
export function wishedQuality(state) {
  const { by, ambient } = state;
  const plain = isPlain(state);
  return {
    samples: choosesRays(state) && state.samples === 1 ? MOST_SAMPLES : state.samples,
    by,
    max_error: keepsError(state) ? state.max_error : null,
    time_budget: plain && !isByField(state.color_map) ? state.time_budget : null,
    voxel_pixels: drawsLabels(state) || (keepsError(state) && state.max_error !== null) ? 0
      : state.voxel_pixels ?? 0,
    ambient: hasOpaque(state) ? ambient : 0,
  };
}

/** Parts of a URL's hash; what is not set is left out. */
function writeQuality({ samples, max_error: error, by, time_budget: time, voxel_pixels: voxels,
  ambient }) {
  const short = (v) => String(Number(v.toPrecision(9)));
  return {
    ...(samples > 1 && { samples }),
    ...(error && { error: short(error) }),
    ...(error && by !== "proof" && { by }),
    ...(time && { ms: short(time) }),
    ...(voxels && { voxels: short(voxels) }),
    ...(ambient && { ambient }),
  };
}

/**
 * What writeQuality() wrote.
 * @param {URLSearchParams} parts
 * @param {(key: string, low: number, high: number) => number | undefined} number reads a part
 * @param {State} before
 * @returns {Partial<State>}
 */
function readQuality(parts, number, before) {
  const by = Object.keys(ERRORS).find((each) => each === parts.get("by"))
    ?? (parts.has("error") ? "proof" : before.by);
  return {
    samples: SAMPLES.find((n) => n === number("samples", 1, 8)),
    ...judgedBy(by, before),
    max_error: number("error", ...ERRORS[by].limits) ?? judgedBy(by, before).max_error,
    time_budget: parts.has("error") ? undefined : number("ms", 1, 10000),
    voxel_pixels: parts.has("error") ? undefined : number("voxels", 0.01, 1000),
    ambient: [0, ...AMBIENT].find((n) => n === number("ambient", 0, 255)),
  };
}

/** Changes of a State for another way to judge errors. An error in another unit does not stay. */
function judgedBy(by, before) {
  return { by, ...(ERRORS[by].unit !== ERRORS[before.by].unit && { max_error: null }) };
}

/** The rows of the panel. */
class QualityRows {
  /** @param {View} view whose state they show and change */
  constructor(view) {
    this.view = view;
    this.hasLevels = false;
  }

  listen(on) {
    const { view } = this;
    on(view.find("[data-name=preset]"), "change", ({ target: { value } }) =>
      view.change(PRESETS[value]));
    const number = (name, optional) => on(view.field(name), "change", ({ target }) => {
      const value = target.value ? Number(target.value) : optional;
      if (target.validity.valid) view.change({ [name]: value });
    });
    number("max_error", null);
    number("time_budget", null);
    number("voxel_pixels", null);
    number("samples");
    number("ambient");
    on(view.field("by"), "change", ({ target }) => {
      const changes = judgedBy(target.value, view.state);
      if (changes.max_error === null) view.field("max_error").value = ""; // with the focus, too
      view.change(changes);
    });
  }

  /** A volume has come. Without coarser levels of detail, none is drawn. */
  welcome({ levels }) {
    this.hasLevels = levels > 1;
    if (!this.hasLevels) this.view.state.voxel_pixels = null;
    this.view.find(".of_levels").hidden = this.hasLevels;
  }

  show(state) {
    const { view } = this;
    const [plain, chooses] = [isPlain(state), choosesRays(state)];
    const { unit, limits: [min, max] } = ERRORS[state.by];
    check(view, "preset", Object.keys(PRESETS).find((name) =>
      Object.entries(PRESETS[name]).every(([key, value]) => state[key] === value)));
    view.field("by").value = state.by;
    view.field("ambient").value = state.ambient;
    view.field("samples").value = wishedQuality(state).samples;
    view.field("samples").options[0].disabled = chooses;
    Object.assign(view.field("max_error"), { min, max });
    view.set("max_error", state.max_error ?? "");
    view.set("time_budget", state.time_budget ?? "");
    view.set("voxel_pixels", state.voxel_pixels ?? "");
    view.find(".of_error").textContent = unit;
    view.find(".of_picture").hidden = !(plain && state.by === "picture");
    view.find(".of_samples").textContent = `${chooses ? "Most rays" : "Rays"} per pixel`;
    view.field("max_error").disabled = !keepsError(state);
    view.field("by").disabled = drawsLabels(state);
    view.field("time_budget").disabled = !plain || isByField(state.color_map);
    view.field("voxel_pixels").disabled = !this.hasLevels || drawsLabels(state);
    view.field("ambient").disabled = !hasOpaque(state);
  }
}
