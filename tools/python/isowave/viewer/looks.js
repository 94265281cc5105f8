// looks.js -- colours by a map, lights, shadows, the background and further clipping planes: what
// wishes and URLs say of them, and their elements in the panel. A part of an ES module
// (front_end.py).

/** @typedef {{colors: string, by: "axis" | "depth" | "field" | "caps" | "labels",
 *    axis: Vec, range: ?[number, number]}} ColorMap as in wishes */
/** @typedef {{rays: number, angle: number}} Shadow as in wishes: rays of a hit towards the light,
 *    and half of the angle that the light has [degrees] */

// As the library has them.
const COLOR_MAPS = ["viridis", "magma", "cividis", "coolwarm", "gray", "labels"];
const AXES = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };
const BY_FIELD = { field: "field", caps: "caps", labels: "labels" }; // ways, as the page names them
const isWay = (by) => by === "depth" || Object.hasOwn(BY_FIELD, by);
const LIGHTS = ["ambient", "diffuse", "specular", "above"]; // as the library has them
const WEIGHTS = [0.15, 0.5, 0.2, 0.45]; // of these, by default
const MAX_PLANES = 8; // beside those of the sliders
const SHADOWS = { 1: "hard", 16: "soft" }; // rays of a hit that one can choose
const BOUNCE = 16; // rays of a hit that bring light
const GRADIENT_TOP = "#7d9cc0"; // the upper edge's colour, until one gives another
const LIGHT_ANGLE = 3; // of soft shadows, unless one gives another [degrees]

/** What the element says that colours are by: x, y, z; "": another axis; field, caps, labels. */
const byName = ({ by, axis }) => (by !== "axis" ? by
  : Object.keys(AXES).find((name) => `${AXES[name]}` === `${axis}`) ?? "");

const numberField = (name, more) =>
  `<span class="unit"><input name="${name}" type="number" step="any" ${more}></span>`;
const options = (texts) => Object.entries(texts).map(([value, text]) =>
  `<option value="${value}">${text}</option>`).join("");
/** HTML of a choice of one, of few. */
const segments = (name, label, texts) => `<div class="segments" role="radiogroup"
  aria-label="${label}" data-name="${name}">${Object.entries(texts).map(([value, text]) =>
  `<label><input type="radio" name="${name}" value="${value}">${text}</label>`).join("")}</div>`;
/** Shows the choice. null: none of them. */
const check = (view, name, value) => {
  for (const radio of view.root.querySelectorAll(`[name=${name}]`)) {
    radio.checked = radio.value === value;
  }
};
const choices = (names) => names.map((name) => `<option>${name}</option>`).join("");
/** HTML of the choice of light and background. */
const LIGHT_ROWS = `
    <label title="Whether the light above turns with the view, or stays where it is now">Light
      <select name="light"><option value="">turns</option><option value="stays">stays</option>
      </select></label>
    <label title="Shadows of opaque surfaces, in a light that stays">Shadows
      <select name="shadow"><option value="">none</option>${options(SHADOWS)}</select></label>
    <label title="Half of the angle that the light has: soft shadows grow with it">Light's angle
      <span class="unit"><input name="light_angle" type="number" min="0.01" max="45" step="any"
        required> °</span></label>
    <label title="What opaque surfaces send on to other places, in a light that stays">
      Bounced light <input name="bounce" type="checkbox"></label>
    <label title="The background goes from its colour at the lower edge to another one at the upper
edge">Gradient <input name="gradient" type="checkbox"></label>
    <label>Upper edge <input name="background_top" type="color" value="${
  GRADIENT_TOP}"></label>`;
/** HTML of the choice of colours. */
const COLOUR_ROWS = `
    ${segments("colour_by", "Colour", { one: "One", field: "Field", depth: "Depth", axis: "Axis" })}
    <label title="Colours of all surfaces: their own, or by a map">Colours
      <select name="color_map"><option value="">own</option>${choices(COLOR_MAPS)}</select></label>
    <label title="By the distance along an axis; by the second volume, the field; by the field on
caps alone; or by labels, those of the second volume or those that are drawn">Colours by
      <select name="color_by">${choices(Object.keys(AXES))}
      <option value="" hidden>other</option>${options(BY_FIELD)}</select></label>
    <label title="Distance or value of the first colour">First colour at ${
  numberField("color_low", 'min="-1e18" max="1e18" placeholder="least"')}</label>
    <label title="Distance or value of the last colour">Last colour at ${
  numberField("color_high", 'min="-1e18" max="1e18" placeholder="largest"')}</label>`;

/** The color_map of a State with other colours ("": the surfaces' own), or by something else. */
export function changeColorMap(before, { colors = before?.colors ?? "", by }) {
  if (!colors) return null;
  if (before && (by === undefined || by === byName(before))) return { ...before, colors };
  const axis = AXES[by] ?? before?.axis ?? AXES.z;
  if (by === "labels") colors = "labels"; // each has a colour of its own
  else if (before?.by === "labels" && colors === "labels") [colors] = COLOR_MAPS;
  return { colors, by: isWay(by) ? by : "axis", axis, range: null };
}

/** Where the light is that turns with a camera: halfway between the eye and above. */
export function lightOf({ eye, at, up }) {
  const back = unit(sub(eye, at));
  const right = unit(cross(up, back));
  return unit(add(back, cross(back, right)));
}

/**
 * @param {State} state
 * @param {?{labels: boolean}} field as in welcome
 * @returns {boolean} whether there are labels to colour surfaces by
 */
const hasLabelColors = (state, field) => drawsLabels(state) || Boolean(field?.labels);

/** What a wish says of colours, lights and the background's upper edge. field: as in welcome */
export function lookOf(state, field) {
  const { color_map: map, lights, light, shadow, bounce, background_top: top } = state;
  const isDrawn = map?.by === "labels" ? hasLabelColors(state, field)
    : !(drawsLabels(state) && isByField(map));
  return { background_top: top && toRgb(top), lights, light,
    color_map: isDrawn ? map : null,
    shadow: hasOpaque(state) && light ? shadow : null,
    bounce: hasOpaque(state) && light ? bounce : 0 };
}

/** Parts of a URL's hash. */
function writeLook({ color_map: map, planes, lights, light, shadow, bounce }) {
  const short = (v) => String(Number(v.toPrecision(9)));
  const of = map && [...(map.by === "axis" ? map.axis.map(short) : [map.by]),
    ...(map.range ?? []).map(short)];
  return {
    ...(map && { map: [map.colors, ...of].join(",") }),
    ...(planes.length && { planes: planes.map(({ normal, offset }) =>
      [...normal, offset].map(short).join("_")).join(",") }),
    ...(light && { light: light.map(short).join(",") }),
    ...(light && shadow && { shadow: [shadow.rays, shadow.angle].map(short).join(",") }),
    ...(light && bounce && { bounce }),
    ...(lights && { lights: LIGHTS.map((name) => short(lights[name])).join(",") }),
  };
}

/** What writeLook() wrote: parts of a State, without what is not understood. */
function readLook(parts) {
  const number = (text) => (text === "" ? NaN : Number(text));
  const numbers = (text) => text.split(",").map(number);
  const good = (list, count) => list.length === count && list.every(Number.isFinite);
  const isDirection = (v) => good(v, 3) && length(v) > 1e-3 && v.every((x) => Math.abs(x) <= 1);
  const state = {};
  const [colors, ...rest] = (parts.get("map") ?? "").split(",");
  const by = isWay(rest[0]) ? rest.shift() : "axis";
  const axis = by === "axis" ? rest.splice(0, 3).map(number) : AXES.z;
  const range = rest.map(number);
  if (COLOR_MAPS.includes(colors) && isDirection(axis)
    && (range.length === 0 || isRange(range))) {
    state.color_map = { colors, by, axis, range: range.length ? range : null };
  }
  const planes = (parts.get("planes") ?? "").split(",").map((text) => text.split("_").map(number));
  if (planes.length <= MAX_PLANES
    && planes.every((p) => good(p, 4) && isDirection(p.slice(0, 3)))) {
    state.planes = planes.map((p) => ({ normal: p.slice(0, 3), offset: p[3] }));
  }
  const light = numbers(parts.get("light") ?? "");
  if (isDirection(light)) state.light = light;
  const [rays, angle, ...more] = numbers(parts.get("shadow") ?? "");
  if (Number.isInteger(rays) && rays >= 1 && rays <= 255 && angle >= 0.01 && angle <= 45
    && more.length === 0) {
    state.shadow = { rays, angle };
  }
  const bounce = number(parts.get("bounce") ?? "");
  if (Number.isInteger(bounce) && bounce >= 1 && bounce <= 255) state.bounce = bounce;
  const weights = numbers(parts.get("lights") ?? "");
  if (good(weights, LIGHTS.length) && weights.every((w) => w >= 0 && w <= 10)) {
    state.lights = Object.fromEntries(LIGHTS.map((name, i) => [name, weights[i]]));
  }
  return state;
}

/** @returns {boolean} whether these are values of the first and the last colour */
function isRange(range) {
  return range.length === 2 && range[0] !== range[1]
    && range.every((value) => Math.abs(value) <= 1e18);
}

/** Two fields for the values of the first and the last colour. */
class RangeFields {
  /**
   * @param {View} view
   * @param {[string, string]} names of the fields
   * @param {(range: ?[number, number]) => void} change hears of both values, or null of none
   */
  constructor(view, names, change) {
    this.ends = names.map((name) => view.field(name));
    this.shown = ""; // as a text
    this.change = change;
  }

  listen(on) {
    for (const end of this.ends) on(end, "change", () => this.read());
  }

  /** Both ends are given, or none. */
  read() {
    const given = this.ends.filter((end) => end.value !== "");
    this.ends.forEach((end) => { end.required = given.length === 1; });
    const range = given.map((end) => Number(end.value));
    const isSame = range.length === 2 && range[0] === range[1];
    this.ends[1].setCustomValidity(isSame ? "Both ends have the same value." : "");
    if (this.ends.every((end) => end.validity.valid)) this.change(range.length ? range : null);
  }

  /** An end that waits for the other one stays. */
  show(range) {
    if (this.shown === `${range ?? ""}`) return;
    this.shown = `${range ?? ""}`;
    this.ends.forEach((end, i) => { end.value = range?.[i] ?? ""; });
  }
}

/** The elements for colour maps, lights, the background and further planes. */
class Look {
  /** @param {View} view whose state it shows and changes */
  constructor(view) {
    this.view = view;
    this.ways = []; // of colours by a field, as the page names them
    this.field = null; // the second volume, as in welcome
    this.range = new RangeFields(view, ["color_low", "color_high"], (range) =>
      view.change({ color_map: { ...view.state.color_map, range } }));
  }

  listen(on) {
    const { view } = this;
    const change = (what) =>
      view.change({ color_map: changeColorMap(view.state.color_map, what) });
    on(view.field("color_by"), "change", (e) => change({ by: e.target.value }));
    on(view.find("[data-name=colour_by]"), "change", ({ target: { value } }) =>
      view.change({ color_map: this.colouredBy(value) }));
    on(view.field("color_map"), "change", ({ target: { value: colors } }) => {
      const isOfLabels = colors === "labels" && hasLabelColors(view.state, this.field);
      change({ colors, by: isOfLabels ? "labels" : undefined });
    });
    this.range.listen(on);
    on(view.field("light"), "change", ({ target: { value } }) => {
      const light = value && view.state.camera ? lightOf(view.state.camera) : null;
      view.change({ light, shadow: light && view.state.shadow,
        bounce: light ? view.state.bounce : 0 });
    });
    on(view.field("shadow"), "change", ({ target: { value } }) => view.change({ shadow: value
      ? { rays: Number(value), angle: view.state.shadow?.angle ?? LIGHT_ANGLE } : null }));
    on(view.field("light_angle"), "change", ({ target: { value, validity } }) => validity.valid
      && view.change({ shadow: { ...view.state.shadow, angle: Number(value) } }));
    on(view.field("bounce"), "change", ({ target: { checked } }) =>
      view.change({ bounce: checked ? BOUNCE : 0 }));
    for (const name of ["background", "background_top"]) {
      on(view.field(name), "input", (e) => view.change({ [name]: e.target.value }));
    }
    on(view.field("gradient"), "change", ({ target: { checked } }) =>
      view.change({ background_top: checked ? view.field("background_top").value : null }));
  }

  /** The color_map of a choice: one, field, depth, axis. */
  colouredBy(choice) {
    const { color_map: map } = this.view.state;
    if (choice === "one") return null;
    const by = choice === "field" ? this.ways[0] : choice === "axis" ? "z" : choice;
    return changeColorMap(map, { colors: map?.colors ?? COLOR_MAPS[0], by });
  }

  /** A volume has come, perhaps with a field. Without one, no colours are by it. */
  welcome({ field }) {
    const { color_map: map } = this.view.state;
    this.field = field;
    if (["field", "caps"].includes(map?.by) && !field) this.view.state.color_map = null;
  }

  show(state) {
    const { view } = this;
    const { color_map: map, light, shadow, bounce } = state;
    const top = state.background_top;
    const isLit = light !== null && hasOpaque(state);
    view.field("light").value = light ? "stays" : "";
    view.field("shadow").value = !shadow ? "" : shadow.rays === 1 ? "1" : "16";
    view.field("shadow").disabled = !isLit;
    view.set("light_angle", shadow?.angle ?? LIGHT_ANGLE);
    view.field("light_angle").disabled = !isLit || !(shadow?.rays > 1);
    view.field("bounce").checked = bounce > 0;
    view.field("bounce").disabled = !isLit;
    view.field("color_map").value = map?.colors ?? "";
    const isOffered = { caps: this.field, labels: hasLabelColors(state, this.field),
      field: this.field && this.field.name !== "volume" }; // a surface has one value of its volume
    for (const by of Object.keys(BY_FIELD)) {
      const option = view.find(`[name=color_by] [value=${by}]`);
      option.hidden = option.disabled = !isOffered[by];
    }
    this.ways = Object.keys(BY_FIELD).filter((by) => isOffered[by]);
    check(view, "colour_by", !map ? "one" : isByField(map) ? "field" : map.by);
    view.find("[name=colour_by][value=field]").disabled = this.ways.length === 0;
    view.field("color_by").value = map && map.by !== "depth" ? byName(map) : "z";
    view.field("color_by").disabled = !map || map.by === "depth";
    for (const name of ["color_by", "color_low", "color_high"]) {
      const isDepth = name === "color_by" && map?.by === "depth";
      view.find(`label:has([name=${name}])`).hidden = !map || isDepth;
    }
    for (const end of this.range.ends) end.disabled = !map || map.by === "labels";
    this.range.show(map?.range);
    view.field("background").value = view.backgroundShown();
    view.field("gradient").checked = top !== null;
    if (top) view.field("background_top").value = top;
    view.find("label:has([name=background_top])").hidden = top === null;
  }
}
