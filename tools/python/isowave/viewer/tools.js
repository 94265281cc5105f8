// tools.js -- the tool strip: what a click on the picture does; what is under the cursor. A part of
// an ES module (front_end.py).

const TOOLS = { // what they are called, what they do, what they look like
  orbit: ["Turn", "Drag to turn", "M13.5 8A5.5 5.5 0 1 1 11 3.4M11 .8v2.8H8.2"],
  pan: ["Move", "Drag to move",
    "M8 1.5v13M1.5 8h13M6 3.5l2-2 2 2M6 12.5l2 2 2-2M3.5 6l-2 2 2 2M12.5 6l2 2-2 2"],
  measure: ["Measure", "Click two points: the distance between them",
    "m1.5 11 9.5-9.5 3.5 3.5L5 14.5zM4 8.5 5.5 10M6.5 6 8 7.5M9 3.5 10.5 5"],
  clip: ["Clip", "Handles of the box and of planes; a click cuts away what is in front",
    "M2 4.5 8 2l6 2.5v7L8 14l-6-2.5zM2 4.5 8 7l6-2.5M8 7v7"],
  slice: ["Slice", "Handles of slices; a click puts one there",
    "M1 10.5 5.5 5H15l-4.5 5.5zM4 13h7"],
  pivot: ["Pivot", "Click: turn about that point (or double click)",
    "M8 1v4M8 11v4M1 8h4M11 8h4M8 5.5a2.5 2.5 0 1 1 0 5 2.5 2.5 0 0 1 0-5z"],
};
/** HTML of the strip. */
const TOOL_STRIP = `<div class="tools" role="toolbar" aria-label="Tools"
  aria-orientation="vertical">${Object.entries(TOOLS).map(([name, [label, title, path]]) =>
  `<button type="button" name="tool_${name}" aria-label="${label}" title="${label}: ${title}"
    aria-pressed="${name === "orbit"}">${icon(path)}</button>`).join("")}<hr>
  <button type="button" name="reset" aria-label="Reset view" title="Reset view (R)">${
  icon("m2 8 6-6 6 6M4 7v7h8V7")}</button></div>`;
const HOVER_MS = 60; // between questions what is under the cursor
const FLY_MS = 250;
const FLY_FACTOR = 0.7; // of the distance

/** Tools, and what is asked about places of the picture. */
class Tools {
  /** @param {View} view */
  constructor(view) {
    this.view = view;
    this.tool = "orbit";
    /** @type {Vec[]} what is measured */
    this.points = [];
    this.waiting = new Map(); // for answers
    this.asked = 0;
    this.hovering = this.flying = 0; // timers
    this.take = (head) => {
      this.waiting.get(head.id)?.(head);
      this.waiting.delete(head.id);
    };
  }

  listen(on) {
    const { view } = this;
    for (const tool of Object.keys(TOOLS)) {
      on(view.field(`tool_${tool}`), "click", () => this.choose(tool));
    }
    on(view.field("reset"), "click", () => view.reset());
    on(view.picture, "pointermove", (e) => this.hover(e));
    on(view.picture, "pointerleave", () => this.say(null));
    on(view.ended.signal, "abort", () => {
      clearTimeout(this.hovering);
      cancelAnimationFrame(this.flying);
    });
  }

  choose(tool) {
    this.tool = tool;
    this.points = [];
    for (const name of Object.keys(TOOLS)) {
      this.view.field(`tool_${name}`).setAttribute("aria-pressed", name === tool);
    }
    this.view.picture.classList.toggle("aims", !["orbit", "pan"].includes(tool));
    this.view.showState();
  }

  /** Lets go of the tool. @returns {boolean} whether there was one */
  letGo() {
    const hadOne = this.tool !== "orbit" || this.points.length > 0;
    if (hadOne) this.choose("orbit");
    return hadOne;
  }

  /** What is seen at a place of the picture: as in the message. */
  ask({ clientX, clientY }) {
    const { left, top, width, height } = this.view.picture.getBoundingClientRect();
    const at = [(clientX - left) / width, (clientY - top) / height].map((x) => clamp(x, 0, 1));
    const id = ++this.asked;
    this.waiting.clear(); // an older question is of no use
    return new Promise((answer) => {
      this.waiting.set(id, answer);
      this.view.home.send({ type: "probe", id, at });
    });
  }

  hover(event) {
    if (event.buttons || event.pointerType === "touch") return this.say(null);
    this.last = event;
    if (this.hovering) return;
    this.hovering = setTimeout(async () => {
      this.hovering = 0;
      if (!this.view.isAtRest || this.waiting.size > 0) return;
      this.say(await this.ask(this.last));
    }, HOVER_MS);
  }

  /** @param {?Message} place null: the cursor is elsewhere */
  say(place) {
    const { view } = this;
    const readout = view.find(".readout");
    if (!place?.position) return readout.replaceChildren();
    const step = Math.max(...sub(...view.volume.box).map(Math.abs)) / 1e4; // no more is seen
    const digits = clamp(Math.ceil(-Math.log10(step)), 0, 9);
    const where = place.position.map((x) => x.toFixed(digits)).join(", ");
    const values = [place.value, place.field].filter((v) => v !== null).map(toText);
    readout.textContent = [`(${where}) ${view.unit}`.trim(), ...values].join(" · ");
  }

  /** A click, or a tap, without a drag. */
  async click(event) {
    const { view, tool } = this;
    if (["orbit", "pan"].includes(tool) || !view.isAtRest) return;
    const { position } = await this.ask(event);
    if (tool !== this.tool) return;
    if (!position) return view.say("There is no surface.");
    if (tool === "measure") {
      this.points = [...(this.points.length > 1 ? [] : this.points), position];
      view.showState();
      if (this.points.length > 1) {
        view.say(`Distance: ${toText(length(sub(...this.points)))} ${view.unit}`);
      }
    } else if (tool === "clip" && view.state.planes.length === 0) {
      view.planes.add(position);
    } else if (tool === "slice") {
      this.slice(position);
    } else if (tool === "pivot") {
      this.fly(lookAt(view.state.camera, position));
    }
  }

  /** Across the axis that the view is nearest to. */
  slice(point) {
    const { view } = this;
    if (isFull(view.state) || drawsLabels(view.state)) return;
    const { eye, at } = view.state.camera;
    const along = sub(at, eye).map(Math.abs);
    const normal = [0, 1, 2].map((k) => Number(k === along.indexOf(Math.max(...along))));
    view.slices.add(normal, dot(normal, point));
  }

  /** Turns about what is there from now on, and flies there. */
  async pivot(event) {
    if (!this.view.isAtRest) return;
    const { position } = await this.ask(event);
    if (position) this.fly(lookAt(this.view.state.camera, position, FLY_FACTOR));
  }

  fly(to) {
    const { view } = this;
    const from = view.state.camera;
    const began = performance.now();
    const between = (a, b, t) => add(a, scale(sub(b, a), t));
    cancelAnimationFrame(this.flying);
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) return view.move(() => to);
    let shown = from;
    const step = (now) => {
      if (view.state.camera !== shown) return; // somebody else moved it
      const t = clamp((now - began) / FLY_MS, 0, 1);
      const s = t * t * (3 - 2 * t);
      const high = to.parallel_height; // then `from` has one, too
      view.move(() => (t === 1 ? to : { ...to, eye: between(from.eye, to.eye, s),
        at: between(from.at, to.at, s),
        ...(high && { parallel_height: from.parallel_height * (1 - s) + high * s }) }));
      shown = view.state.camera;
      if (t < 1) this.flying = requestAnimationFrame(step);
    };
    this.flying = requestAnimationFrame(step);
  }
}
