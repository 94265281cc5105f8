// labels.js -- surfaces of a segmentation's labels, which come in place of isosurfaces: what
// wishes, URLs and scene files say of them, and their list in the panel. A part of an ES module
// (front_end.py).

/** @typedef {{labels: number[], color: string, opacity: number, shown: boolean}} Group
 *    labels of one surface, in their order */

const MAX_LABEL = 65535; // as the library has it
const MAX_GROUP = 128; // labels of a surface
/** HTML of the list. */
const LABEL_ROWS = `
    <div class="label_part" hidden><h2>Labels</h2>
    <p class="hint of_labels" hidden>Drawn in place of surfaces, slices and colours by a field.</p>
    <ol class="surfaces groups" aria-label="Labels"></ol>
    <div class="buttons"><button type="button" name="add_labels"
      title="The surface of a label, or of several: 3, 7-9">Add labels</button></div></div>`;
const LABEL_ROW = `<li>
  <input name="color" type="color">
  <input name="labels" type="text" required>
  <input name="opacity" type="range" min="${LEAST_OPACITY}" max="1" step="0.05">
  <button type="button" aria-pressed="true">${EYE}</button><button type="button">×</button></li>`;

/** @returns {boolean} whether surfaces of labels are drawn */
export const drawsLabels = ({ labels }) => labels.some((group) => group.shown);

/**
 * The labels of a text such as "3, 7-9", in their order.
 * @param {string} text
 * @param {string} between labels
 * @returns {?number[]} null: nothing that is understood
 */
export function parseLabels(text, between = ",") {
  const labels = new Set();
  for (const part of text.split(between)) {
    const [, first, last] = /^\s*(\d{1,5})(?:\s*-\s*(\d{1,5}))?\s*$/.exec(part) ?? [];
    const [low, high] = [Number(first), Number(last ?? first)];
    if (!(low <= high && high <= MAX_LABEL && high - low < MAX_GROUP)) return null;
    for (let label = low; label <= high; ++label) labels.add(label);
  }
  return labels.size <= MAX_GROUP ? [...labels].sort((a, b) => a - b) : null;
}

/** What parseLabels() reads. */
export function textOfLabels(labels, between = ", ") {
  const runs = [];
  for (const label of labels) {
    const run = runs.at(-1);
    if (run?.[1] === label - 1) run[1] = label;
    else runs.push([label, label]);
  }
  return runs.map(([low, high]) => (low === high ? low : `${low}-${high}`)).join(between);
}

/** Parts of a URL's hash. */
function writeLabels({ labels: groups }) {
  const list = groups.map(({ labels, color, opacity, shown }) => [textOfLabels(labels, "."),
    color.slice(1), Number(opacity.toPrecision(9)), ...(shown ? [] : ["hidden"])].join("_"));
  return list.length ? { labels: list.join(",") } : {};
}

/** What writeLabels() wrote: parts of a State, without what is not understood. */
function readLabels(parts) {
  const groups = (parts.get("labels") ?? "").split(",").map((text) => {
    const [list, color, opacity, hidden] = text.split("_");
    return { labels: parseLabels(list, "."), color: `#${color}`, opacity: Number(opacity),
      shown: hidden !== "hidden" };
  });
  const isGood = ({ labels, color, opacity }) => labels && /^#[0-9a-f]{6}$/i.test(color)
    && opacity >= LEAST_OPACITY && opacity <= 1;
  return groups.length <= MAX_SURFACES && groups.every(isGood) ? { labels: groups } : {};
}

/** Labels of a scene file's surfaces, as a State has them. */
function readSceneLabels(surfaces) {
  return surfaces.map(({ labels, color, opacity }) => {
    if (labels.length > MAX_GROUP) {
      throw new Error(`This page shows up to ${MAX_GROUP} labels of a surface.`);
    }
    return { labels: [...new Set(labels)].sort((a, b) => a - b), color: toHex(color),
      opacity: Math.max(opacity, LEAST_OPACITY), shown: true };
  });
}

/** The list in the panel: a row for each surface of labels. */
class LabelList {
  /** @param {View} view whose state has the labels */
  constructor(view) {
    this.view = view;
    this.list = view.find(".groups");
    this.isUseful = true; // there may be labels in the volume
  }

  listen(on) {
    on(this.view.field("add_labels"), "click", () => this.add());
  }

  /** Labels are integers that the library takes. */
  welcome({ dtype, range: [low, high] }) {
    this.isUseful = /^u?int/.test(dtype) && low >= 0 && high <= MAX_LABEL;
    this.view.find(".label_part").hidden = !this.isUseful;
  }

  /** The one after the largest. */
  add() {
    const { labels: groups } = this.view.state;
    const largest = Math.max(0, ...groups.flatMap(({ labels }) => labels));
    const color = COLORS.find((c) => groups.every((g) => g.color !== c)) ?? COLORS[0];
    const group = { labels: [Math.min(largest + 1, MAX_LABEL)], color, opacity: 1, shown: true };
    this.view.change({ labels: [...groups, group] });
  }

  edit(index, changes) {
    const { labels } = this.view.state;
    this.view.change({ labels: labels.map((g, i) => (i === index ? { ...g, ...changes } : g)) });
  }

  remove(index) {
    const { labels } = this.view.state;
    this.view.change({ labels: labels.filter((_, i) => i !== index) });
    this.view.field("add_labels").focus(); // the row that had the focus may be gone
  }

  show(state) {
    const { list, view } = this;
    if (!this.isUseful) state.labels = []; // an address may have some
    const { labels: groups } = state;
    const inPlace = drawsLabels(state);
    while (list.children.length > groups.length) list.lastElementChild.remove();
    while (list.children.length < groups.length) this.addRow(list.children.length);
    groups.forEach((group, i) => {
      const [color, text, opacity, eye] = list.children[i].querySelectorAll("input, button");
      const percent = `${Math.round(100 * group.opacity)} %`;
      color.value = group.color;
      if (text !== list.getRootNode().activeElement) {
        text.value = textOfLabels(group.labels);
        text.setCustomValidity("");
      }
      opacity.value = group.opacity;
      opacity.setAttribute("aria-valuetext", percent);
      opacity.title = `Opacity: ${percent}`;
      eye.setAttribute("aria-pressed", group.shown);
    });
    view.find(".of_labels").hidden = !inPlace;
    view.field("add_labels").disabled = groups.length >= MAX_SURFACES;
    for (const part of [".surfaces", ".slices", ".iso"]) view.find(part).inert = inPlace;
  }

  addRow(i) {
    this.list.insertAdjacentHTML("beforeend", LABEL_ROW);
    const elements = this.list.lastElementChild.querySelectorAll("input, button");
    const [color, text, opacity, eye, remove] = elements;
    const names = ["Colour of", "Labels of", "Opacity of", "Show", "Remove"];
    elements.forEach((element, k) => {
      element.setAttribute("aria-label", `${names[k]} group ${i + 1}`);
      element.title = `${names[k]} group ${i + 1}`;
    });
    color.addEventListener("input", () => this.edit(i, { color: color.value }));
    text.addEventListener("input", () => {
      const labels = parseLabels(text.value);
      text.setCustomValidity(labels ? "" : `Give labels from 0 to ${MAX_LABEL}, such as 3, 7-9.`);
      if (labels) this.edit(i, { labels });
    });
    opacity.addEventListener("input", () => this.edit(i, { opacity: Number(opacity.value) }));
    eye.addEventListener("click", () =>
      this.edit(i, { shown: eye.getAttribute("aria-pressed") !== "true" }));
    remove.addEventListener("click", () => this.remove(i));
  }
}
