// surfaces.js -- the surfaces of a picture: what wishes and URLs say of them, their list in the
// panel. A part of an ES module (front_end.py).

/** @typedef {{isovalue: number, color: string, opacity: number, shown: boolean}} Surface */

const MAX_SURFACES = 8; // as the library has it
const LEAST_OPACITY = 0.05;
const ADDED_OPACITY = 0.5; // what is behind it is seen
// As the library colours them.
const COLORS = ["#dbbd87", "#56b4e9", "#d55e00", "#009e73", "#cc79a7", "#0072b2", "#f0e442",
  "#e69f00"];

/** @returns {Surface} */
const makeSurface = (isovalue, color = COLORS[0], opacity = 1, shown = true) =>
  ({ isovalue, color, opacity, shown });

/** The surfaces that a State shows: those of labels, or of isovalues. */
const drawnSurfaces = (state) =>
  (drawsLabels(state) ? state.labels : state.surfaces).filter((s) => s.shown);

/** @returns {boolean} whether one opaque isosurface is drawn; a wish needs no list of it */
const isOne = (drawn) => drawn.length === 1 && drawn[0].opacity === 1 && !drawn[0].labels;

/** @returns {boolean} whether one opaque isosurface is drawn alone, with all that quality has */
export const isPlain = (state) => isOne(drawnSurfaces(state)) && state.slices.length === 0;

/** @returns {boolean} whether ambient and shadow rays can end at a surface */
export const hasOpaque = (state) => drawnSurfaces(state).some((s) => s.opacity === 1);

/** @returns {boolean} whether the values of a second volume are shown, without a time budget */
const isByField = (map) => map !== null && !["axis", "depth"].includes(map.by);

/** A State as a wish's surfaces and slices. */
export function wishedSurfaces(state) {
  const { surfaces, slices, slice_map } = state;
  const [drawn, first] = [drawnSurfaces(state), surfaces.find((s) => s.shown)];
  return {
    isovalue: first.isovalue,
    color: toRgb(first.color),
    surfaces: isOne(drawn) ? [] : drawn.map(({ labels, isovalue, color, opacity }) =>
      ({ ...(labels ? { labels } : { isovalue }), color: toRgb(color), opacity })),
    slices: drawsLabels(state) ? [] : slices,
    slice_map,
  };
}

/** The surfaces with one more, at a suggested isovalue or in the middle of the widest gap. */
export function addSurface(surfaces, suggested, [low, high]) {
  const near = (high - low) / 100;
  const isNew = (value) => surfaces.every((s) => Math.abs(s.isovalue - value) > near);
  const values = [low, ...surfaces.map((s) => clamp(s.isovalue, low, high)), high]
    .sort((a, b) => a - b);
  const gaps = values.slice(1).map((value, i) => value - values[i]);
  const widest = gaps.indexOf(Math.max(...gaps));
  const middle = (values[widest] + values[widest + 1]) / 2;
  const color = COLORS.find((c) => surfaces.every((s) => s.color !== c)) ?? COLORS[0];
  return [...surfaces, makeSurface(suggested.find(isNew) ?? middle, color, ADDED_OPACITY)];
}

/** The surfaces without one; one at least is shown. */
export function removeSurface(surfaces, index) {
  const left = surfaces.filter((_, i) => i !== index);
  if (!left.some((s) => s.shown)) left[0] = { ...left[0], shown: true };
  return left;
}

/** Parts of a URL's hash: iso and color of one opaque surface; else surfaces. */
function writeSurfaces(surfaces) {
  const short = (v) => String(Number(v.toPrecision(9)));
  const [first] = surfaces;
  const rest = surfaces.map((s) => [short(s.isovalue), s.color.slice(1), short(s.opacity),
    ...(s.shown ? [] : ["hidden"])].join("_"));
  if (surfaces.length > 1 || first.opacity < 1) return { surfaces: rest.join(",") };
  return { iso: short(first.isovalue), color: first.color.slice(1) };
}

/**
 * What writeSurfaces() wrote.
 * @returns {Surface[] | undefined} undefined: nothing that is understood
 */
function readSurfaces(text) {
  const surfaces = text.split(",").map((part) => {
    const [value, color, opacity, hidden] = part.split("_");
    return makeSurface(value ? Number(value) : NaN, `#${color}`, Number(opacity),
      hidden !== "hidden");
  });
  const isGood = ({ isovalue, color, opacity }) => Math.abs(isovalue) <= 3.4e38
    && /^#[0-9a-f]{6}$/i.test(color) && opacity >= LEAST_OPACITY && opacity <= 1;
  const isUsable = surfaces.every(isGood) && surfaces.some((s) => s.shown)
    && surfaces.length <= MAX_SURFACES;
  return isUsable ? surfaces : undefined;
}

const EYE = `<svg viewBox="0 0 16 16" width="16" height="16" fill="none" stroke="currentColor"
  stroke-width="1.4" aria-hidden="true"><path d="M1 8q7-9 14 0q-7 9-14 0z"/>
  <circle cx="8" cy="8" r="2"/><path class="off" d="M2 14 14 2"/></svg>`;
const SURFACE_ROW = `<li>
  <input name="color" type="color">
  <input name="value" type="number" step="any" min="-3.4e38" max="3.4e38" required>
  <input name="opacity" type="range" min="${LEAST_OPACITY}" max="1" step="0.05">
  <button type="button" aria-pressed="true">${EYE}</button><button type="button">×</button></li>`;

/** The list in the panel: a row for each surface. The row with the focus is the selected one. */
class SurfaceList {
  /** @param {View} view whose state has the surfaces */
  constructor(view) {
    this.view = view;
    this.list = view.find(".surfaces");
  }

  edit(index, changes) {
    const { surfaces } = this.view.state;
    this.view.change({
      surfaces: surfaces.map((s, i) => (i === index ? { ...s, ...changes } : s)) });
  }

  select(index) {
    if (index === this.view.state.selected) return;
    this.view.state.selected = index;
    this.view.showState();
  }

  /** @param {number=} isovalue else a suggested one, or the middle of the widest gap */
  add(isovalue) {
    const { state: { surfaces }, histogram: { whole } } = this.view;
    if (!whole) return;
    const added = addSurface(surfaces, this.peaks, whole);
    if (isovalue !== undefined) added.at(-1).isovalue = isovalue;
    this.view.change({ surfaces: added, selected: surfaces.length });
  }

  get peaks() {
    return this.view.histogram.data?.suggested ?? [];
  }

  listen(on) {
    const { view } = this;
    on(view.field("add"), "click", () => this.add());
    on(view.field("peak"), "change", ({ target }) => {
      this.add(Number(target.value));
      target.value = "";
    });
  }

  /** The suggested isovalues that no surface has. */
  showPeaks(surfaces) {
    const field = this.view.field("peak");
    const left = this.peaks.filter((peak) => surfaces.every((s) => s.isovalue !== peak));
    if (field.dataset.left === `${left}`) return;
    field.dataset.left = left;
    field.replaceChildren(new Option("Add at peak …", ""),
      ...left.map((peak) => new Option(toText(peak), peak)));
  }

  remove(index) {
    const surfaces = removeSurface(this.view.state.surfaces, index);
    this.view.change({ surfaces, selected: Math.min(index, surfaces.length - 1) });
    this.view.field("add").focus(); // the row that had the focus may be gone
  }

  show(state) {
    const { list, view } = this;
    const { surfaces, selected, color_map: map } = state;
    while (list.children.length > surfaces.length) list.lastElementChild.remove();
    while (list.children.length < surfaces.length) this.addRow(list.children.length);
    const count = surfaces.filter((s) => s.shown).length;
    surfaces.forEach((surface, i) => {
      const row = list.children[i];
      const [color, value, opacity, eye, remove] = row.querySelectorAll("input, button");
      row.toggleAttribute("aria-current", false);
      if (i === selected && surfaces.length > 1) row.setAttribute("aria-current", "true");
      color.value = surface.color;
      color.disabled = map !== null && !isByField(map);
      if (value !== list.getRootNode().activeElement) {
        value.value = Number.isFinite(surface.isovalue) ? toText(surface.isovalue) : "";
      }
      opacity.value = surface.opacity;
      opacity.setAttribute("aria-valuetext", `${Math.round(100 * surface.opacity)} %`);
      opacity.title = `Opacity: ${Math.round(100 * surface.opacity)} %`;
      eye.setAttribute("aria-pressed", surface.shown);
      eye.disabled = surface.shown && count === 1;
      remove.disabled = surfaces.length === 1;
    });
    view.field("add").disabled = isFull(state) || drawsLabels(state);
    this.showPeaks(surfaces);
    view.field("peak").disabled = view.field("add").disabled
      || view.field("peak").options.length < 2;
  }

  addRow(i) {
    this.list.insertAdjacentHTML("beforeend", SURFACE_ROW);
    const row = this.list.lastElementChild;
    const [color, value, opacity, eye, remove] = row.querySelectorAll("input, button");
    const labels = ["Colour", "Isovalue", "Opacity", "Show", "Remove"];
    [color, value, opacity, eye, remove].forEach((element, k) => {
      const label = k < 3 ? `${labels[k]} of surface ${i + 1}` : `${labels[k]} surface ${i + 1}`;
      element.setAttribute("aria-label", label);
      element.title = label;
    });
    row.addEventListener("focusin", () => this.select(i));
    color.addEventListener("input", () => this.edit(i, { color: color.value }));
    value.addEventListener("input", () => {
      if (value.validity.valid) this.edit(i, { isovalue: Number(value.value) });
    });
    opacity.addEventListener("input", () => this.edit(i, { opacity: Number(opacity.value) }));
    eye.addEventListener("click", () =>
      this.edit(i, { shown: eye.getAttribute("aria-pressed") !== "true" }));
    remove.addEventListener("click", () => this.remove(i));
  }
}
