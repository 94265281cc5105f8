// histogram.js -- the histogram, with a handle for each surface, its scale and zoom. A part of an
// ES module (front_end.py).

const THUMB = 12; // width of a slider's thumb, CSS pixels
const HISTOGRAM_ZOOM = 1.6; // of a press
const LEAST_SHARE = 1e-4; // of the range that is shown
/** HTML of the row. */
const HISTOGRAM_ROW = `
  <section class="iso" aria-label="Isovalue">
    <label class="number">Isovalue
      <input name="isovalue" type="number" step="any" min="-3.4e38" max="3.4e38" required></label>
    <div class="histogram">
      <canvas aria-hidden="true"></canvas>
      <div class="ticks"></div>
      <div class="handles"></div>
      <div class="ends" aria-hidden="true"><span></span><span></span><span></span></div>
    </div>
    <div class="scales">
      <button type="button" name="log" class="flag" aria-pressed="true"
        title="Heights by the logarithm of the number of voxels">log</button>
      <button type="button" name="zoom_in" aria-label="Show fewer values"
        title="Show fewer values (wheel over the histogram)">+</button>
      <button type="button" name="zoom_all" title="Show all values">All</button>
      <button type="button" name="zoom_out" aria-label="Show more values"
        title="Show more values">−</button>
    </div>
  </section>`;

/**
 * Draws bars, those that the selected surface encloses in the accent's colour.
 * @param {HTMLCanvasElement} canvas
 * @param {{counts: number[], range: [number, number]}} histogram
 * @param {[number, number]} range that is shown
 * @param {number} isovalue of the selected surface
 * @param {boolean} isLog
 */
function paintHistogram(canvas, histogram, [low, high], isovalue, isLog) {
  const ratio = devicePixelRatio;
  const [width, height] = [canvas.clientWidth * ratio, canvas.clientHeight * ratio];
  if (!(width > 0)) return;
  Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d");
  const { color, outlineColor } = getComputedStyle(canvas); // the bars', in this scheme
  const { counts, range: [from, to] } = histogram;
  const inset = (THUMB / 2) * ratio; // the thumb's middle goes from here to there
  const x = (v) => clamp(Math.round(inset + ((v - low) / (high - low || 1))
    * (width - 2 * inset)), 0, width);
  const edge = (k) => from + ((to - from) * k) / counts.length;
  const isSeen = (_, i) => edge(i + 1) > low && edge(i) < high;
  const size = isLog ? Math.log1p : (count) => count;
  const seen = counts.filter(isSeen).sort((a, b) => b - a);
  // A background of one value would flatten all other bars.
  const most = size(isLog ? seen[0] || 1 : Math.min(seen[0], 4 * (seen[2] || seen[0])) || 1);
  counts.forEach((count, i) => {
    if (!isSeen(count, i)) return;
    const [a, b] = [x(edge(i)), x(edge(i + 1))];
    const bar = Math.min(1, size(count) / most) * (height - ratio);
    const inside = edge(i + 1) > isovalue;
    context.fillStyle = inside ? color : outlineColor;
    context.globalAlpha = inside ? 0.55 : 1;
    context.fillRect(a, height - bar, Math.max(1, b - a), bar);
  });
}

/** The histogram's row: the selected isovalue as a number, bars, handles, ticks. */
class Histogram {
  /** @param {View} view whose state has the isovalues */
  constructor(view) {
    this.view = view;
    this.canvas = view.find(".histogram canvas");
    this.handles = view.find(".handles");
    this.data = null; // as in the message
    this.whole = this.range = null; // the volume's values; those that are shown
    this.isLog = true;
    this.note = "voxels";
  }

  listen(on) {
    const { view, canvas } = this;
    on(view.field("isovalue"), "input", ({ target }) => target.validity.valid
      && view.surfaces.edit(view.state.selected, { isovalue: Number(target.value) }));
    on(view.field("log"), "click", () => {
      this.isLog = !this.isLog;
      this.show(view.state);
    });
    on(view.field("zoom_in"), "click", () => this.zoom(HISTOGRAM_ZOOM));
    on(view.field("zoom_out"), "click", () => this.zoom(1 / HISTOGRAM_ZOOM));
    on(view.field("zoom_all"), "click", () => this.zoom(0));
    on(view.find(".histogram"), "wheel", (e) => {
      if (!this.range) return;
      e.preventDefault();
      this.zoom(Math.exp(clamp(-e.deltaY * 0.002, -1, 1)), this.valueAt(e));
    }, { passive: false });
    on(canvas, "dblclick", () => this.zoom(0));
    on(canvas, "pointerdown", (e) => {
      canvas.setPointerCapture(e.pointerId);
      this.point(e);
    });
    on(canvas, "pointermove", (e) => canvas.hasPointerCapture(e.pointerId) && this.point(e));
    on(this.handles, "input", ({ target }) => this.take(target));
    for (const type of ["focusin", "pointerdown"]) {
      on(this.handles, type, ({ target }) =>
        view.surfaces.select([...this.handles.children].indexOf(target)));
    }
    on(view.find(".ticks"), "click", ({ target }) => target.dataset.value
      && view.surfaces.edit(view.state.selected, { isovalue: Number(target.dataset.value) }));
  }

  welcome({ range, dtype }) {
    this.isWhole = /int/.test(dtype);
    this.whole = this.range = range;
  }

  set(data) {
    this.data = data;
    this.view.showState();
  }

  /** The value under a pointer. */
  valueAt({ clientX }) {
    const { left, width } = this.canvas.getBoundingClientRect();
    const [low, high] = this.range;
    const share = clamp((clientX - left - THUMB / 2) / (width - THUMB || 1), 0, 1);
    return low + share * (high - low);
  }

  point(event) {
    if (!this.range) return;
    const value = this.valueAt(event);
    const isovalue = this.isWhole && this.step >= 1 ? Math.round(value)
      : Number(value.toPrecision(5));
    this.view.surfaces.edit(this.view.state.selected, { isovalue });
  }

  take(handle) {
    const index = [...this.handles.children].indexOf(handle);
    this.view.surfaces.edit(index, { isovalue: Number(handle.value) });
  }

  /** factor: above 1: fewer values; 0: all. about: the value that keeps its place. */
  zoom(factor, about = this.view.surface.isovalue) {
    if (!this.range) return;
    const [[low, high], [least, largest]] = [this.range, this.whole];
    const size = Math.max((high - low) / factor, (largest - least) * LEAST_SHARE);
    const middle = clamp(about, low, high);
    const from = middle - ((middle - low) / (high - low || 1)) * size;
    const begin = clamp(from, least, Math.max(least, largest - size));
    this.range = factor === 0 || size >= largest - least ? this.whole : [begin, begin + size];
    this.show(this.view.state);
  }

  get step() {
    const [low, high] = this.range;
    const step = (high - low) / 1000;
    return this.isWhole ? Math.max(1, Math.round(step)) : step || "any";
  }

  show(state) {
    const { view, handles, range } = this;
    const { isovalue } = view.surface;
    view.set("isovalue", Number.isFinite(isovalue) ? toText(isovalue) : "");
    view.field("log").setAttribute("aria-pressed", this.isLog);
    if (!range) return;
    const { surfaces, selected } = state;
    while (handles.children.length > surfaces.length) handles.lastElementChild.remove();
    while (handles.children.length < surfaces.length) {
      handles.insertAdjacentHTML("beforeend", '<input name="slider" type="range">');
    }
    [...handles.children].forEach((handle, i) => {
      const { isovalue: value, color, shown } = surfaces[i];
      const number = surfaces.length > 1 ? ` of surface ${i + 1}` : "";
      Object.assign(handle, { min: range[0], max: range[1], step: this.step, value });
      handle.setAttribute("aria-label", `Isovalue${number} on the histogram`);
      handle.setAttribute("aria-valuetext", toText(value));
      handle.title = toText(value);
      handle.style.setProperty("--c", color);
      handle.style.opacity = shown ? 1 : 0.35;
      handle.style.zIndex = i === selected ? 1 : 0;
      handle.hidden = value < range[0] || value > range[1];
      if (surfaces.length === 1) handle.hidden = false;
    });
    const [low, note, high] = view.root.querySelectorAll(".ends span");
    [low.textContent, high.textContent] = range.map(toText);
    note.textContent = `${this.note}, ${this.isLog ? "log" : "linear"} scale`;
    this.showTicks();
    if (this.data) paintHistogram(this.canvas, this.data, range, isovalue, this.isLog);
  }

  /** Suggested isovalues: between the peaks. */
  showTicks() {
    const [ticks, [low, high]] = [this.view.find(".ticks"), this.range];
    const values = (this.data?.suggested ?? []).filter((v) => v >= low && v <= high);
    const key = `${values}|${low}|${high}`;
    if (key === this.ticksShown) return;
    this.ticksShown = key;
    ticks.replaceChildren(...values.map((value) => {
      const tick = document.createElement("button");
      Object.assign(tick, { type: "button", title: `Suggested: ${toText(value)}` });
      tick.setAttribute("aria-label", tick.title);
      tick.dataset.value = value;
      const share = (value - low) / (high - low || 1);
      tick.style.left = `calc(${THUMB / 2}px + ${share} * (100% - ${THUMB}px))`;
      return tick;
    }));
  }
}
