// overlay.js -- what is drawn over the picture: handles of box, planes and slices, what is
// measured, the point that the view turns about. A part of an ES module (front_end.py).

const HANDLE = 7; // radius [CSS pixels]
const TIP = 0.16; // of the volume's diagonal: how long the arrow of a plane is
const EDGES = [0, 1, 2].flatMap((axis) => [0, 1, 2, 3].map((i) => {
  const [b, c] = [0, 1, 2].filter((k) => k !== axis);
  const from = [0, 0, 0];
  [from[b], from[c]] = [i & 1, i >> 1];
  return [from, from.map((x, k) => (k === axis ? 1 : x))];
})); // of a unit cube

/** How world space lies in the picture: a function to [x, y, depth], y down; null: behind. */
export function projector(camera, width, height) {
  const forward = unit(sub(camera.at, camera.eye));
  const right = unit(cross(forward, camera.up));
  const up = cross(right, forward);
  return (point) => {
    const to = sub(point, camera.eye);
    const depth = dot(to, forward);
    const pixels = height / heightAt(camera, depth); // of a unit of the world
    return depth > 0 ? [width / 2 + pixels * dot(to, right), height / 2 - pixels * dot(to, up),
      depth] : null;
  };
}

/** The corners, in order, of what a plane has in common with a box; []: nothing. */
export function cutOf({ normal, offset }, [begin, end]) {
  const corner = (unitCorner) => unitCorner.map((x, k) => (x ? end[k] : begin[k]));
  const points = EDGES.flatMap(([from, to]) => {
    const [a, b] = [corner(from), corner(to)];
    const [da, db] = [a, b].map((p) => dot(normal, p) - offset);
    return da * db < 0 ? [add(a, scale(sub(b, a), da / (da - db)))] : [];
  });
  if (points.length < 3) return [];
  const middle = scale(points.reduce(add), 1 / points.length);
  const along = unit(sub(points[0], middle));
  const across = cross(unit(normal), along);
  const angle = (p) => Math.atan2(dot(sub(p, middle), across), dot(sub(p, middle), along));
  return points.sort((p, q) => angle(p) - angle(q));
}

/** The SVG over the picture. */
class Overlay {
  /** @param {View} view */
  constructor(view) {
    this.view = view;
    this.svg = view.find(".overlay");
    this.handles = []; // what each one does
  }

  listen(on) {
    const { svg, view } = this;
    let held = null;
    on(svg, "pointerdown", (e) => {
      const handle = this.handles[e.target.dataset?.handle];
      if (!handle) return;
      svg.setPointerCapture(e.pointerId);
      held = { handle, x: e.clientX, y: e.clientY };
    });
    on(svg, "pointermove", (e) => {
      if (held) held.handle(e.clientX - held.x, e.clientY - held.y);
    });
    for (const type of ["pointerup", "pointercancel"]) on(svg, type, () => { held = null; });
    on(svg, "wheel", (e) => view.gestures.wheel(e), { passive: false });
  }

  show(state) {
    const { view, svg } = this;
    const { clientWidth: width, clientHeight: height } = view.picture;
    const { camera } = state;
    this.handles = [];
    if (!camera || !view.volume?.box || !(height > 0)) return svg.replaceChildren();
    this.project = projector(camera, width, height);
    const { tool, points } = view.tools;
    svg.innerHTML = [
      tool === "clip" ? this.ofBox(state) + this.ofPlanes(state) : "",
      tool === "slice" && !drawsLabels(state) ? this.ofSlices(state) : "",
      tool === "pivot" ? this.mark(camera.at) : "",
      this.ofMeasured(points),
    ].join("");
  }

  /** The path along points, "" if one is behind the eye. */
  path(points, end = "") {
    const seen = points.map(this.project);
    return seen.length && seen.every(Boolean)
      ? `M${seen.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L")}${end}` : "";
  }

  /** HTML of a handle. drag: hears how far it is from where it was [CSS pixels]. */
  handle(point, drag) {
    const at = this.project(point);
    if (!at) return "";
    this.handles.push(drag);
    return `<circle class="handle" data-handle="${this.handles.length - 1}" r="${HANDLE}"
      cx="${at[0].toFixed(1)}" cy="${at[1].toFixed(1)}"/>`;
  }

  /** What a handle does that moves along a direction from a point: hears how far. */
  along(point, direction, move) {
    const [x, y, depth] = this.project(point) ?? [0, 0, 1];
    const step = depth * 1e-3;
    const [px, py] = this.project(add(point, scale(direction, step))) ?? [x, y];
    const [ax, ay] = [(px - x) / step, (py - y) / step]; // pixels of a unit of the world
    const square = ax * ax + ay * ay;
    const focus = this.view.picture.clientHeight
      / (this.view.state.camera.parallel_height ?? depth);
    // Towards the eye: up is away.
    return (dx, dy) => move(square > (0.05 * focus) ** 2 ? (dx * ax + dy * ay) / square
      : -dy / focus);
  }

  ofBox({ clip }) {
    const { view } = this;
    const [begin, end] = view.volume.box;
    const at = (axis, i) => begin[axis] + (clip[2 * axis + i] / 100) * (end[axis] - begin[axis]);
    const lines = EDGES.map((edge) =>
      this.path(edge.map((corner) => corner.map((i, axis) => at(axis, i))))).join("");
    const middle = [0, 1, 2].map((axis) => (at(axis, 0) + at(axis, 1)) / 2);
    const handles = clip.map((percent, i) => {
      const axis = i >> 1;
      const point = middle.map((x, k) => (k === axis ? at(axis, i % 2) : x));
      const direction = [0, 1, 2].map((k) => Number(k === axis));
      return this.handle(point, this.along(point, direction, (far) => {
        const moved = percent + (100 * far) / (end[axis] - begin[axis] || 1);
        const place = clamp(Number(moved.toFixed(2)), 0, 100);
        view.change({ clip: moveClip(view.state.clip, i, place) });
      }));
    }).join("");
    return `<path class="under" d="${lines}"/><path d="${lines}"/>${handles}`;
  }

  /** A plane of the list: its outline, a handle in the middle that moves it. */
  plane(plane, edit) {
    const corners = cutOf(plane, this.view.volume.box);
    const { normal, offset } = plane;
    const centre = corners.length ? scale(corners.reduce(add), 1 / corners.length)
      : add(this.middle, scale(normal, offset - dot(normal, this.middle)));
    const handle = this.handle(centre, this.along(centre, normal, (far) =>
      edit({ offset: offset + far })));
    return { centre, html: `<path class="face" d="${this.path(corners, "Z")}"/>${handle}` };
  }

  get middle() {
    return scale(add(...this.view.volume.box), 0.5);
  }

  ofPlanes({ planes, camera }) {
    const { view } = this;
    const reach = TIP * length(sub(...view.volume.box));
    return planes.map((plane, i) => {
      const edit = (changes) => view.planes.edit(i, changes);
      const { centre, html } = this.plane(plane, edit);
      const tip = add(centre, scale(plane.normal, reach));
      const turnBy = this.inView(tip, camera);
      const arrow = this.handle(tip, (dx, dy) => {
        const normal = sub(add(tip, turnBy(dx, dy)), centre);
        if (!(length(normal) > reach * 1e-3)) return;
        edit({ normal: unit(normal), offset: dot(unit(normal), centre) });
      });
      return `<path d="${this.path([centre, tip])}"/>${html}${arrow}`;
    }).join("");
  }

  /** How far a point goes with the pointer, as deep as it is. */
  inView(point, camera) {
    const forward = unit(sub(camera.at, camera.eye));
    const right = unit(cross(forward, camera.up));
    const up = cross(right, forward);
    const depth = dot(sub(point, camera.eye), forward);
    const pixel = heightAt(camera, depth) / this.view.picture.clientHeight;
    return (dx, dy) => add(scale(right, dx * pixel), scale(up, -dy * pixel));
  }

  ofSlices({ slices }) {
    return slices.map((slice, i) =>
      this.plane(slice, (changes) => this.view.slices.edit(i, changes)).html).join("");
  }

  mark(point) {
    const at = this.project(point);
    return at ? `<path d="M${at[0] - 9} ${at[1]}h18M${at[0]} ${at[1] - 9}v18"/>` : "";
  }

  ofMeasured(points) {
    const line = this.path(points);
    const marks = points.map((point) => this.mark(point)).join("");
    if (points.length < 2 || !line) return marks;
    const [a, b] = points.map(this.project);
    const far = `${toText(length(sub(...points)))} ${this.view.unit}`.trim();
    return `<path class="under" d="${line}"/><path d="${line}"/>${marks}
      <text x="${(a[0] + b[0]) / 2 + 10}" y="${(a[1] + b[1]) / 2 - 8}">${far}</text>`;
  }
}
