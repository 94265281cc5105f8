// clip.js -- clipping: sliders for the part of the volume that is drawn, and planes. A part of an
// ES module (front_end.py).

const WHOLE = [0, 100, 0, 100, 0, 100]; // clip of a State that leaves out nothing
const LEAST_CLIP = 1; // between both ends of an axis [%]
/** HTML of the sliders: a row with two for each axis of the world. */
const CLIP_ROWS = ["x", "y", "z"].map((axis) => `
    <div class="clip"><span aria-hidden="true">${axis}</span><div>${
  ["from", "to"].map((end) => `<input type="range" min="0" max="100" step="0.5"
      name="clip_${axis}_${end}" aria-label="${axis} ${end}">`).join("")}</div></div>`).join("");

/** HTML of the list of planes. */
const PLANE_ROWS = `
    <ol class="plane_list" aria-label="Planes"></ol>
    <div class="buttons"><button type="button" name="add_plane"
      title="Cuts away what is in front of the middle, as seen now">Add plane</button></div>`;
const PLANE_ROW = `<li><span></span>
  <input name="plane_position" type="range">
  <input name="plane_offset" type="number" step="any" min="-1e18" max="1e18" required>
  <button type="button">⇄</button><button type="button">×</button></li>`;

/** A changed end of the range along an axis: the other end stays, a little apart. */
export function moveClip(clip, i, percent) {
  const moved = [...clip];
  moved[i] = i % 2 ? Math.max(percent, clip[i - 1] + LEAST_CLIP)
    : Math.min(percent, clip[i + 1] - LEAST_CLIP);
  return moved;
}

/**
 * The clipping planes of a wish.
 * @param {number[]} clip as in State
 * @param {[Vec, Vec]} box corners of the volume's box in world space
 */
export function clipPlanes(clip, [begin, end]) {
  return clip.flatMap((percent, i) => {
    if (percent === WHOLE[i]) return [];
    const [axis, sign] = [i >> 1, i % 2 ? -1 : 1];
    const at = begin[axis] + (percent / 100) * (end[axis] - begin[axis]);
    return [{ normal: [0, 1, 2].map((k) => (k === axis ? sign : 0)), offset: sign * at }];
  });
}

/**
 * What clipPlanes() made of sliders, and the planes that it did not.
 * @param {{normal: Vec, offset: number}[]} planes
 * @param {[Vec, Vec]} box as in clipPlanes()
 * @returns {{clip: number[], planes: {normal: Vec, offset: number}[]}}
 */
export function slidersOf(planes, box) {
  const clip = [...WHOLE];
  const others = planes.filter(({ normal, offset }) => {
    const axis = normal.findIndex((part) => Math.abs(part) === 1);
    if (axis < 0 || length(normal) !== 1) return true;
    const i = 2 * axis + (normal[axis] < 0 ? 1 : 0);
    const at = (normal[axis] * offset - box[0][axis]) / (box[1][axis] - box[0][axis]);
    const offsetAt = (percent) =>
      clipPlanes(WHOLE.map((whole, k) => (k === i ? percent : whole)), box)[0]?.offset;
    const percent = Number((100 * at).toFixed(2)); // as handles have it
    const moved = clip.map((before, k) => (k === i ? percent : before));
    if (clip[i] !== WHOLE[i] || !isClip(moved) || offsetAt(percent) !== offset) return true;
    clip[i] = percent;
    return false;
  });
  return { clip: others.length === planes.length ? WHOLE : clip, planes: others };
}

/** @returns {boolean} whether it is a State's clip */
function isClip(clip) {
  return clip.length === 6 && [0, 2, 4].every((i) =>
    clip[i] >= 0 && clip[i] + LEAST_CLIP <= clip[i + 1] && clip[i + 1] <= 100);
}

/** The list in the panel: a row for each plane. */
class PlaneList {
  /** @param {View} view whose state has the planes */
  constructor(view) {
    this.view = view;
    this.list = view.find(".plane_list");
  }

  listen(on) {
    on(this.view.field("add_plane"), "click", () => this.add());
  }

  /** What is in front of a point, as seen now, is cut away. */
  add(point = scale(add(...this.view.volume.box), 0.5)) {
    const { state: { planes, camera } } = this.view;
    if (!camera || planes.length >= MAX_PLANES) return;
    const normal = unit(sub(camera.at, camera.eye));
    this.view.change({ planes: [...planes, { normal, offset: dot(normal, point) }] });
  }

  edit(index, changes) {
    const { planes } = this.view.state;
    this.view.change({ planes: planes.map((p, i) => (i === index ? { ...p, ...changes } : p)) });
  }

  remove(index) {
    const { planes } = this.view.state;
    this.view.change({ planes: planes.filter((_, i) => i !== index) });
    this.view.field("add_plane").focus(); // the row that had the focus may be gone
  }

  show({ planes }) {
    const { list, view } = this;
    while (list.children.length > planes.length) list.lastElementChild.remove();
    while (list.children.length < planes.length) this.addRow(list.children.length);
    planes.forEach(({ normal, offset }, i) => {
      const [position, number] = list.children[i].querySelectorAll("input");
      list.children[i].querySelector("span").textContent = i + 1;
      list.children[i].title = `Plane of normal ${normal.map(toShort).join(", ")}`;
      if (view.volume) {
        const [min, max] = offsetsOf(normal, view.volume.box);
        Object.assign(position, { min, max, step: (max - min) / POSITIONS || "any" });
      }
      position.value = offset;
      position.setAttribute("aria-valuetext", toText(offset));
      if (number !== view.root.activeElement) number.value = toText(offset);
    });
    view.field("add_plane").disabled = planes.length >= MAX_PLANES;
  }

  addRow(i) {
    this.list.insertAdjacentHTML("beforeend", PLANE_ROW);
    const elements = this.list.lastElementChild.querySelectorAll("input, button");
    const [position, offset, flip, remove] = elements;
    ["Position of", "Offset of", "Turn round", "Remove"].forEach((label, k) => {
      elements[k].title = `${label} plane ${i + 1}`;
      elements[k].setAttribute("aria-label", elements[k].title);
    });
    position.addEventListener("input", () => this.edit(i, { offset: Number(position.value) }));
    offset.addEventListener("input", () => {
      if (offset.validity.valid) this.edit(i, { offset: Number(offset.value) });
    });
    flip.addEventListener("click", () => {
      const { normal, offset: at } = this.view.state.planes[i];
      this.edit(i, { normal: scale(normal, -1), offset: -at });
    });
    remove.addEventListener("click", () => this.remove(i));
  }
}
