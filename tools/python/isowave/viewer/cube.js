// cube.js -- a small cube that shows how the volume is turned, whose faces are buttons; the scale
// bar. A part of an ES module (front_end.py).

/** HTML of the cube. */
const CUBE = `<svg class="cube" viewBox="-42 -42 84 84" role="group" aria-label="Views">${
  Object.entries(VIEW_NAMES).map(([side, name]) => `<g data-side="${side}" role="button"
    tabindex="0" aria-label="${name} view"><title>${name}</title><polygon/><text dy="6"/></g>`)
    .join("")}</svg>`;
const CUBE_HALF = 23; // of an edge
const LETTERS = { front: "A", back: "P", left: "L", right: "R", top: "S", bottom: "I" };
const AXIS_LETTERS = { front: "z", back: "−z", left: "−x", right: "x", top: "y", bottom: "−y" };
const BAR_SHARE = 0.16; // of the picture's width, at most, of the scale bar

/** A round length that is at most so long: 1, 2 or 5 times a power of ten. */
export function roundLength(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return power * [5, 2, 1].find((n) => n * power <= most * (1 + 1e-9));
}

/** Cube and scale bar. */
class Cube {
  /** @param {View} view whose camera they show */
  constructor(view) {
    this.view = view;
    this.faces = [...view.root.querySelectorAll(".cube g")];
  }

  listen(on) {
    const { view } = this;
    const turnTo = (side) => view.move((c) => seenFrom(c, view.sides, side));
    on(view.root, "click", ({ target }) => {
      const { side } = target.closest("[data-side]")?.dataset ?? {};
      if (side) turnTo(side);
    });
    on(view.find(".cube"), "keydown", (e) => {
      if (e.key !== "Enter" && e.key !== " ") return;
      e.preventDefault();
      turnTo(e.target.dataset.side);
    });
  }

  show({ camera, annotations }) {
    this.showScale(camera, annotations);
    this.view.find(".cube").toggleAttribute("hidden", !camera);
    if (!camera) return;
    const { sides, volume } = this.view;
    const forward = unit(sub(camera.at, camera.eye));
    const right = unit(cross(forward, camera.up));
    const up = cross(right, forward);
    const flat = (v) => [CUBE_HALF * dot(v, right), -CUBE_HALF * dot(v, up)];
    for (const face of this.faces) {
      const { side } = face.dataset;
      const normal = sides[side];
      const isSeen = dot(normal, forward) < -0.05;
      face.setAttribute("display", isSeen ? "inline" : "none");
      if (!isSeen) continue;
      const top = { top: sides.back, bottom: sides.front }[side] ?? sides.top;
      const across = cross(top, normal);
      const corner = (a, b) => flat(add(normal, add(scale(across, a), scale(top, b))));
      const [polygon, text] = face.querySelectorAll("polygon, text");
      polygon.setAttribute("points", [[1, 1], [1, -1], [-1, -1], [-1, 1]]
        .map(([a, b]) => corner(a, b).join()).join(" "));
      text.textContent = (volume?.anatomical ? LETTERS : AXIS_LETTERS)[side];
      const unitOf = (v) => flat(v).map((x) => x / CUBE_HALF);
      const matrix = [unitOf(across), unitOf(scale(top, -1)), flat(normal)].flat();
      text.setAttribute("transform", `matrix(${matrix.map((x) => x.toFixed(3))})`);
    }
  }

  /** The length that a part of the picture has, as deep as what the camera looks at. */
  showScale(camera, { what }) {
    const { view } = this;
    const { clientWidth: width, clientHeight: height } = view.picture;
    const scaleBar = view.find(".scale");
    // One in the picture is enough.
    scaleBar.hidden = !camera || !(height > 0) || what.includes("scale-bar");
    if (scaleBar.hidden) return;
    const pixel = heightAt(camera, length(sub(camera.at, camera.eye))) / height;
    const bar = roundLength(pixel * width * BAR_SHARE);
    scaleBar.querySelector("i").style.width = `${bar / pixel}px`;
    scaleBar.querySelector("span").textContent = `${toText(bar)} ${view.unit}`.trim();
  }
}
