// slices.js -- slices, which are planes that show the voxels: what wishes, URLs and scene files say
// of them, and their list in the panel. A part of an ES module (front_end.py).

/** @typedef {{normal: Vec, offset: number, opacity: number, clipped: boolean}} Slice
 *    as in wishes; the normal has length 1 */
/** @typedef {{colors: string, range: ?[number, number]}} SliceMap as in wishes */

const GRAY = { colors: "gray", range: null }; // slice_map of a State at first
const POSITIONS = 200; // steps of the slider that moves a slice
const SLICE_BUTTONS = Object.keys(AXES).map((axis) => `
      <button type="button" name="slice_${axis}"
      title="Surfaces and slices: at most ${MAX_SURFACES}">Add ${axis}</button>`).join("");
/** HTML of the list of slices and their colours. */
const SLICE_ROWS = `
    <ol class="slices" aria-label="Slices"></ol>
    <div class="buttons thirds">${SLICE_BUTTONS}</div>
    <div class="slice_look" hidden>
    <label title="Colours of all slices">Slices' colours
      <select name="slice_colors">${choices(COLOR_MAPS)}</select></label>
    <label title="Value of the first colour">First colour at ${
  numberField("slice_low", 'min="-1e18" max="1e18" placeholder="least"')}</label>
    <label title="Value of the last colour">Last colour at ${
  numberField("slice_high", 'min="-1e18" max="1e18" placeholder="largest"')}</label></div>`;
const SLICE_ROW = `<li><span></span>
  <input name="position" type="range">
  <input name="offset" type="number" step="any" min="-1e18" max="1e18" required>
  <button type="button">×</button>
  <div><span>Opacity</span>
  <input name="opacity" type="range" min="${LEAST_OPACITY}" max="1" step="0.05">
  <label>clipped <input name="clipped" type="checkbox"></label></div></li>`;

/**
 * The least and the largest offset of a slice that meets the volume's box [world units].
 * @param {Vec} normal
 * @param {[Vec, Vec]} box
 */
export function offsetsOf(normal, [begin, end]) {
  const ends = normal.map((n, k) => [n * begin[k], n * end[k]]);
  return [Math.min, Math.max].map((choose) =>
    ends.reduce((sum, pair) => sum + choose(...pair), 0));
}

/** The name of a slice's direction: x, y, z; n: another one. */
const directionOf = ({ normal }) =>
  Object.keys(AXES).find((axis) => `${AXES[axis]}` === `${normal}`) ?? "n";

/** @returns {boolean} whether a picture has as many surfaces and slices as it may have */
export const isFull = ({ surfaces, slices }) => surfaces.length + slices.length >= MAX_SURFACES;

/** The changes of a State that leave so many slices as there is room for beside its surfaces. */
const fitSlices = (before, changes) => {
  const { surfaces, slices } = { ...before, ...changes };
  const room = MAX_SURFACES - surfaces.length;
  return slices.length > room ? { ...changes, slices: slices.slice(0, room) } : changes;
};

/** Parts of a URL's hash. */
function writeSlices({ slices, slice_map: { colors, range } }) {
  const short = (v) => String(Number(v.toPrecision(9)));
  const list = slices.map(({ normal, offset, opacity, clipped }) =>
    [...[...normal, offset, opacity].map(short), ...(clipped ? [] : ["whole"])].join("_"));
  return {
    ...(list.length && { slices: list.join(",") }),
    ...((colors !== GRAY.colors || range) && {
      slice_map: [colors, ...(range ?? []).map(short)].join(",") }),
  };
}

/** What writeSlices() wrote: parts of a State, without what is not understood. */
function readSlices(parts) {
  const state = {};
  const number = (text) => (text ? Number(text) : NaN);
  const slices = (parts.get("slices") ?? "").split(",").map((text) => {
    const [x, y, z, offset, opacity, whole] = text.split("_");
    const normal = [x, y, z].map(number);
    const isGood = normal.every((n) => Math.abs(n) <= 1) && length(normal) > 1e-3
      && Math.abs(number(offset)) <= 1e18 && number(opacity) >= LEAST_OPACITY
      && number(opacity) <= 1 && [undefined, "whole"].includes(whole);
    return isGood && { normal, offset: number(offset), opacity: number(opacity),
      clipped: whole === undefined };
  });
  if (slices.length < MAX_SURFACES && slices.every(Boolean)) state.slices = slices;
  const [colors, ...ends] = (parts.get("slice_map") ?? "").split(",");
  const range = ends.map(number);
  if (COLOR_MAPS.includes(colors) && (range.length === 0 || isRange(range))) {
    state.slice_map = { colors, range: range.length ? range : null };
  }
  return state;
}

/** Fields of a scene file. */
function writeSceneSlices(state) {
  const { slices, slice_map: { colors, range } } = state;
  if (!slices.length || drawsLabels(state)) return {};
  return { slices, slice_map: colors,
    ...(range && { slice_low: range[0], slice_high: range[1] }) };
}

/**
 * Parts of a State.
 * @param {Record<string, any>} fields as readScene() has them
 * @throws {Error} that says what this page cannot show
 */
function readSceneSlices({ slices = [], slice_map: colors, slice_table: table, slice_low: low,
  slice_high: high }) {
  const hasRange = typeof low === "number";
  if (slices.length && table?.length) throw new Error("This page shows no tables of colours.");
  if (hasRange && !(Math.max(Math.abs(low), Math.abs(high)) <= 1e18)) {
    throw new Error("This page shows colours of values up to 1e18.");
  }
  if (slices.some(({ normal, offset }) => !(Math.abs(offset) / length(normal) <= 1e18))) {
    throw new Error("This page shows slices up to 1e18 from the origin.");
  }
  return {
    slices: slices.map(({ normal, offset, opacity, clipped }) => ({ normal: unit(normal),
      offset: offset / length(normal), opacity: Math.max(opacity, LEAST_OPACITY), clipped })),
    slice_map: { colors: colors || GRAY.colors, range: hasRange ? [low, high] : null },
  };
}

/** The list in the panel: a row for each slice. */
class SliceList {
  /** @param {View} view whose state has the slices */
  constructor(view) {
    this.view = view;
    this.list = view.find(".slices");
    this.range = new RangeFields(view, ["slice_low", "slice_high"], (range) =>
      view.change({ slice_map: { ...view.state.slice_map, range } }));
  }

  listen(on) {
    const { view } = this;
    for (const axis of Object.keys(AXES)) {
      on(view.field(`slice_${axis}`), "click", () => this.add(AXES[axis]));
    }
    on(view.field("slice_colors"), "change", ({ target }) => view.change({
      slice_map: { ...view.state.slice_map, colors: target.value } }));
    this.range.listen(on);
  }

  /** @param {number=} offset else it goes through the middle of the volume */
  add(normal, offset) {
    const { state: { slices }, volume } = this.view;
    if (!volume) return;
    const [low, high] = offsetsOf(normal, volume.box);
    const slice = { normal, offset: offset ?? (low + high) / 2, opacity: 1, clipped: true };
    this.view.change({ slices: [...slices, slice] });
  }

  edit(index, changes) {
    const { slices } = this.view.state;
    this.view.change({ slices: slices.map((s, i) => (i === index ? { ...s, ...changes } : s)) });
  }

  remove(index) {
    const { slices } = this.view.state;
    this.view.change({ slices: slices.filter((_, i) => i !== index) });
    this.view.field("slice_x").focus(); // the row that had the focus may be gone
  }

  show(state) {
    const { list, view } = this;
    const { slices, slice_map: { colors, range } } = state;
    while (list.children.length > slices.length) list.lastElementChild.remove();
    while (list.children.length < slices.length) this.addRow(list.children.length);
    slices.forEach((slice, i) => this.showRow(list.children[i], slice));
    for (const axis of Object.keys(AXES)) {
      view.field(`slice_${axis}`).disabled = isFull(state) || drawsLabels(state);
    }
    view.find(".slice_look").hidden = slices.length === 0 || drawsLabels(state);
    view.field("slice_colors").value = colors;
    this.range.show(range);
  }

  showRow(row, slice) {
    const [position, offset, , opacity, clipped] = row.querySelectorAll("input, button");
    const percent = `${Math.round(100 * slice.opacity)} %`;
    row.querySelector("span").textContent = directionOf(slice);
    row.title = `Slice of normal ${slice.normal.map(toShort).join(", ")}`;
    if (this.view.volume) {
      const [min, max] = offsetsOf(slice.normal, this.view.volume.box);
      Object.assign(position, { min, max, step: (max - min) / POSITIONS || "any" });
    }
    position.value = slice.offset;
    position.setAttribute("aria-valuetext", toText(slice.offset));
    if (offset !== row.getRootNode().activeElement) offset.value = toText(slice.offset);
    opacity.value = slice.opacity;
    opacity.setAttribute("aria-valuetext", percent);
    opacity.title = `Opacity: ${percent}`;
    clipped.checked = slice.clipped;
  }

  addRow(i) {
    this.list.insertAdjacentHTML("beforeend", SLICE_ROW);
    const row = this.list.lastElementChild;
    const elements = row.querySelectorAll("input, button");
    const [position, offset, remove, opacity, clipped] = elements;
    const labels = ["Position of", "Offset of", "Remove", "Opacity of", "Clipping planes cut"];
    elements.forEach((element, k) => {
      element.setAttribute("aria-label", `${labels[k]} slice ${i + 1}`);
      element.title = `${labels[k]} slice ${i + 1}`;
    });
    position.addEventListener("input", () => this.edit(i, { offset: Number(position.value) }));
    offset.addEventListener("input", () => {
      if (offset.validity.valid) this.edit(i, { offset: Number(offset.value) });
    });
    opacity.addEventListener("input", () => this.edit(i, { opacity: Number(opacity.value) }));
    clipped.addEventListener("change", () => this.edit(i, { clipped: clipped.checked }));
    remove.addEventListener("click", () => this.remove(i));
  }
}
