// looks.js -- colours by a map, lights, shadows and further clipping planes: what wishes and URLs
// say of them, and their elements in the panel. A part of an ES module (front_end.py).

/** @typedef {{colors: string, by: "axis" | "field" | "caps", axis: Vec,
 *    range: ?[number, number]}} ColorMap as in wishes */
/** @typedef {{rays: number, angle: number}} Shadow as in wishes: rays of a hit towards the light,
 *    and half of the angle that the light has [degrees] */

const COLOR_MAPS = ["viridis", "magma", "cividis", "coolwarm", "gray"]; // as the library has them
const AXES = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };
const BY_FIELD = { field: "field", caps: "caps" }; // ways, as the page names them
const LIGHTS = ["ambient", "diffuse", "specular", "above"]; // as the library has them
const MAX_PLANES = 8; // beside those of the sliders
const SHADOWS = { 1: "hard", 16: "soft" }; // rays of a hit that one can choose
const LIGHT_ANGLE = 3; // of soft shadows, unless one gives another [degrees]

/** What the element says that colours are by: x, y, z; "": another axis; field, caps. */
const byName = ({ by, axis }) => (by !== "axis" ? by
  : Object.keys(AXES).find((name) => `${AXES[name]}` === `${axis}`) ?? "");

const numberField = (name, more) =>
  `<span class="unit"><input name="${name}" type="number" step="any" ${more}></span>`;
const options = (texts) => Object.entries(texts).map(([value, text]) =>
  `<option value="${value}">${text}</option>`).join("");
const choices = (names) => names.map((name) => `<option>${name}</option>`).join("");
/** HTML of the choice of colours and light. */
const LOOK_ROWS = `
    <label title="Whether the light above turns with the view, or stays where it is now">Light
      <select name="light"><option value="">turns</option><option value="stays">stays</option>
      </select></label>
    <label title="Shadows of one opaque surface, in a light that stays">Shadows
      <select name="shadow"><option value="">none</option>${options(SHADOWS)}</select></label>
    <label title="Half of the angle that the light has: soft shadows grow with it">Light's angle
      <span class="unit"><input name="light_angle" type="number" min="0.01" max="45" step="any"
        required> °</span></label>
    <label title="Colours of all surfaces: their own, or by a map">Colours
      <select name="color_map"><option value="">own</option>${choices(COLOR_MAPS)}</select></label>
    <label title="By the distance along an axis; by the second volume, the field; or by the field
on caps alone">Colours by
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
  return { colors, by: Object.hasOwn(BY_FIELD, by) ? by : "axis", axis, range: null };
}

/** Where the light is that turns with a camera: halfway between the eye and above. */
export function lightOf({ eye, at, up }) {
  const back = unit(sub(eye, at));
  const right = unit(cross(up, back));
  return unit(add(back, cross(back, right)));
}

/** What a wish says of colours and lights. */
export function lookOf({ surfaces, color_map: map, lights, light, shadow }) {
  return { color_map: map, lights, light,
    shadow: hasOpaque(surfaces) && light ? shadow : null };
}

/** Parts of a URL's hash. */
function writeLook({ color_map: map, planes, lights, light, shadow }) {
  const short = (v) => String(Number(v.toPrecision(9)));
  const of = map && [...(map.by === "axis" ? map.axis.map(short) : [map.by]),
    ...(map.range ?? []).map(short)];
  return {
    ...(map && { map: [map.colors, ...of].join(",") }),
    ...(planes.length && { planes: planes.map(({ normal, offset }) =>
      [...normal, offset].map(short).join("_")).join(",") }),
    ...(light && { light: light.map(short).join(",") }),
    ...(light && shadow && { shadow: [shadow.rays, shadow.angle].map(short).join(",") }),
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
  const by = Object.hasOwn(BY_FIELD, rest[0]) ? rest.shift() : "axis";
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

/** The elements for colour maps, lights and further planes. */
class Look {
  /** @param {View} view whose state it shows and changes */
  constructor(view) {
    this.view = view;
    this.ends = ["color_low", "color_high"].map((name) => view.field(name));
    this.shownRange = ""; // as a text
  }

  listen(on) {
    const { view } = this;
    for (const [name, what] of [["color_map", "colors"], ["color_by", "by"]]) {
      on(view.field(name), "change", (e) => view.change({
        color_map: changeColorMap(view.state.color_map, { [what]: e.target.value }) }));
    }
    for (const end of this.ends) on(end, "change", () => this.changeRange());
    on(view.field("light"), "change", ({ target: { value } }) => {
      const light = value && view.state.camera ? lightOf(view.state.camera) : null;
      view.change({ light, shadow: light && view.state.shadow });
    });
    on(view.field("shadow"), "change", ({ target: { value } }) => view.change({ shadow: value
      ? { rays: Number(value), angle: view.state.shadow?.angle ?? LIGHT_ANGLE } : null }));
    on(view.field("light_angle"), "change", ({ target: { value, validity } }) => validity.valid
      && view.change({ shadow: { ...view.state.shadow, angle: Number(value) } }));
    on(view.field("drop_planes"), "click", () => view.change({ planes: [] }));
  }

  /** Both ends, or none: then the range is that of the box, or of the field at the hits. */
  changeRange() {
    const given = this.ends.filter((end) => end.value !== "");
    this.ends.forEach((end) => { end.required = given.length === 1; });
    const range = given.map((end) => Number(end.value));
    const isSame = range.length === 2 && range[0] === range[1];
    this.ends[1].setCustomValidity(isSame ? "Both ends have the same value." : "");
    if (!this.ends.every((end) => end.validity.valid)) return;
    const { color_map: map } = this.view.state;
    this.view.change({ color_map: { ...map, range: range.length ? range : null } });
  }

  /** A volume has come, perhaps with a field. Without one, no colours are by it. */
  welcome({ field }) {
    const { view } = this;
    for (const by of Object.keys(BY_FIELD)) {
      const option = view.find(`[name=color_by] [value=${by}]`);
      // A surface has one value of its own volume.
      option.hidden = option.disabled = !field || (by === "field" && field.name === "volume");
    }
    const { color_map: map } = view.state;
    if (map && map.by !== "axis" && !field) view.state.color_map = null;
  }

  show({ surfaces, color_map: map, planes: { length: count }, light, shadow }) {
    const { view } = this;
    const hasShadow = light !== null && hasOpaque(surfaces);
    view.field("light").value = light ? "stays" : "";
    view.field("shadow").value = !shadow ? "" : shadow.rays === 1 ? "1" : "16";
    view.field("shadow").disabled = !hasShadow;
    view.set("light_angle", shadow?.angle ?? LIGHT_ANGLE);
    view.field("light_angle").disabled = !hasShadow || !(shadow?.rays > 1);
    view.field("color_map").value = map?.colors ?? "";
    view.field("color_by").value = map ? byName(map) : "z";
    for (const field of [view.field("color_by"), ...this.ends]) field.disabled = !map;
    if (this.shownRange !== `${map?.range ?? ""}`) { // an end that waits for the other one stays
      this.shownRange = `${map?.range ?? ""}`;
      this.ends.forEach((end, i) => { end.value = map?.range?.[i] ?? ""; });
    }
    view.find(".planes").hidden = count === 0;
    view.find(".planes span").textContent = `${count} further plane${count === 1 ? "" : "s"}`;
  }
}
