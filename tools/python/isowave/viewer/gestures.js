// gestures.js -- what pointers, wheels and keys do on the picture. A part of an ES module
// (front_end.py).

const CLICK_PX = 4; // a pointer that goes less far was pressed, not dragged
const TYPES_TEXT = "input:not([type=range], [type=checkbox], [type=radio], [type=color]), textarea";

/** What people do on the picture. */
class Gestures {
  /** @param {View} view whose camera they move */
  constructor(view) {
    this.view = view;
    this.fingers = new Map();
    this.start = null; // of a press that may be a click
  }

  listen(on) {
    const { view, fingers } = this;
    const { picture } = view;
    on(picture, "pointerdown", (e) => {
      picture.setPointerCapture(e.pointerId);
      fingers.set(e.pointerId, e);
      this.start = fingers.size === 1 && e.button === 0 ? e : null;
    });
    on(picture, "pointermove", (e) => {
      const last = fingers.get(e.pointerId);
      if (!last) return;
      const { start } = this;
      const isFar = start && Math.hypot(e.clientX - start.clientX, e.clientY - start.clientY)
        > CLICK_PX;
      if (isFar) this.start = null;
      this.drag(last, e);
      fingers.set(e.pointerId, e);
    });
    on(picture, "pointerup", (e) => {
      fingers.delete(e.pointerId);
      if (this.start) view.tools.click(e);
      this.start = null;
    });
    on(picture, "pointercancel", (e) => fingers.delete(e.pointerId));
    on(picture, "contextmenu", (e) => e.preventDefault());
    on(picture, "dblclick", (e) => view.tools.pivot(e));
    on(picture, "wheel", (e) => this.wheel(e), { passive: false });
    on(picture, "keydown", (e) => this.key(e));
    on(view.root, "keydown", (e) => {
      this.command(e);
      e.stopPropagation(); // notebooks have keys of their own
    });
    // In a page of its own, the keys work while nothing has the focus.
    if (view.home.hash) {
      on(document, "keydown", (e) => {
        if (e.target !== document.body) return;
        this.command(e);
        if (!e.defaultPrevented) this.key(e);
      });
    }
  }

  drag(last, now) {
    const { view, fingers } = this;
    const height = view.picture.clientHeight;
    const dx = (now.clientX - last.clientX) / height;
    const dy = (now.clientY - last.clientY) / height;
    const isPan = now.buttons & 6 || now.shiftKey || view.tools.tool === "pan";
    if (fingers.size > 1) {
      this.pinch([...fingers.values()].find((f) => f.pointerId !== now.pointerId), last, now);
    } else if (now.altKey) {
      const [x, y] = this.fromMiddle(now);
      const [before, after] = [[x - dx, y + dy], [x, y]].map(([a, b]) => Math.atan2(b, a));
      view.move((c) => roll(c, before - after));
    } else if (isPan) {
      view.move((c) => pan(c, dx, dy));
    } else {
      view.move((c) => orbit(c, dx * Math.PI, dy * Math.PI, view.sides.top));
    }
  }

  /** Two fingers, of which one has moved: they carry, zoom and roll the picture. */
  pinch(other, last, now) {
    const height = this.view.picture.clientHeight;
    const from = (f) => [f.clientX - other.clientX, f.clientY - other.clientY];
    const [[ax, ay], [bx, by]] = [from(last), from(now)];
    const factor = (Math.hypot(ax, ay) || 1) / (Math.hypot(bx, by) || 1);
    const angle = Math.atan2(ax * by - ay * bx, ax * bx + ay * by);
    // Each finger moves the middle by half of its way.
    const [dx, dy] = [(bx - ax) / 2 / height, (by - ay) / 2 / height];
    this.view.move((c) => roll(zoom(pan(c, dx, dy), factor), angle));
  }

  /** Where a pointer is from the middle, to the right and up [picture heights]. */
  fromMiddle({ clientX, clientY }) {
    const { left, top, width, height } = this.view.picture.getBoundingClientRect();
    return [(clientX - left - width / 2) / height, -(clientY - top - height / 2) / height];
  }

  wheel(event) {
    const { view } = this;
    if (!event.ctrlKey && !view.home.wheel(view)) return; // the page is to scroll
    event.preventDefault();
    const pixels = event.deltaY * [1, 16, 400][event.deltaMode];
    const strength = event.ctrlKey ? 0.01 : 0.001; // pinches of touchpads come as ctrl and wheel
    const factor = Math.exp(clamp(pixels * strength, -1, 1));
    view.move((c) => zoomTo(c, factor, ...this.fromMiddle(event)));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { view } = this;
    const move = moveOfKey(event, view.sides);
    if (move) view.move(move);
    else if (["0", "r", "R"].includes(event.key)) view.reset();
    else return;
    event.preventDefault();
  }

  /** Keys that work wherever the focus is. */
  command(event) {
    const { view } = this;
    const key = event.key.toLowerCase();
    if (key === "escape") {
      if (view.cameras.closePaste() || view.menus.close() || view.tools.letGo()) {
        event.preventDefault();
      }
    } else if ((event.ctrlKey || event.metaKey) && !event.altKey && (key === "z" || key === "y")) {
      if (event.composedPath()[0].matches?.(TYPES_TEXT)) return; // texts have an undo of their own
      if (key === "y" || event.shiftKey) view.history.redo();
      else view.history.undo();
      event.preventDefault();
    }
  }
}
