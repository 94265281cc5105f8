// menus.js -- what the buttons of the top bar open; the sheet of small windows. A part of an ES
// module (front_end.py).

const icon = (path) => `<svg class="icon" viewBox="0 0 16 16" width="16" height="16"
  aria-hidden="true"><path d="${path}"/></svg>`;

/** What the buttons of the top bar open: one at a time. */
class Menus {
  /** @param {View} view */
  constructor(view) {
    this.view = view;
    this.buttons = [...view.root.querySelectorAll(".menu > button")];
  }

  listen(on) {
    for (const button of this.buttons) {
      on(button, "click", () => this.open(button.getAttribute("aria-expanded") === "true"
        ? null : button));
    }
    on(this.view.root, "pointerdown", (e) => {
      if (!e.target.closest(".menu")) this.open(null);
    });
    on(this.view.host, "focusout", ({ relatedTarget }) => {
      if (relatedTarget && !this.view.host.contains(relatedTarget)) this.open(null);
    });
  }

  /** @param {?Element} opened a button; null: none */
  open(opened) {
    for (const button of this.buttons) {
      const isOpen = button === opened;
      if (isOpen === (button.getAttribute("aria-expanded") === "true")) continue;
      button.setAttribute("aria-expanded", isOpen);
      button.nextElementSibling.hidden = !isOpen;
      if (isOpen) this.view.opened(button.name);
    }
  }

  /** @returns {boolean} whether there was something to close; its button gets the focus */
  close() {
    const open = this.buttons.find((b) => b.getAttribute("aria-expanded") === "true");
    this.open(null);
    open?.focus();
    return open !== undefined;
  }
}

const STOPS = 3; // of the sheet: histogram; surfaces; all

/** The panel beside the picture, or the sheet over it in small windows. */
class Sheet {
  /** @param {View} view */
  constructor(view) {
    this.view = view;
    this.frame = view.find(".frame");
    this.grip = view.find(".grip");
    this.stop = 1;
  }

  get isSmall() {
    return this.view.host.clientWidth <= 640;
  }

  listen(on) {
    let from = null;
    on(this.view.find(".toggle"), "click", () =>
      this.setStop(this.stop > 0 ? 0 : this.isSmall ? 1 : 2));
    on(this.grip, "click", (e) => {
      if (!e.detail || !this.hasMoved) this.setStop((this.stop + 1) % STOPS);
      this.hasMoved = false;
    });
    on(this.grip, "pointerdown", (e) => {
      this.grip.setPointerCapture(e.pointerId);
      from = { y: e.clientY, stop: this.stop };
      this.hasMoved = false;
    });
    on(this.grip, "pointermove", (e) => {
      if (!from) return;
      const steps = Math.round((from.y - e.clientY) / (this.view.host.clientHeight * 0.35));
      this.hasMoved ||= Math.abs(from.y - e.clientY) > 8;
      this.setStop(clamp(from.stop + steps, 0, STOPS - 1));
    });
    for (const type of ["pointerup", "pointercancel"]) on(this.grip, type, () => { from = null; });
  }

  /** @param {number} stop 0: the panel is closed */
  setStop(stop) {
    this.stop = stop;
    this.frame.dataset.stop = stop;
    this.frame.classList.toggle("closed", stop === 0);
    this.view.find(".toggle").setAttribute("aria-expanded", stop > 0);
    this.grip.setAttribute("aria-label", stop < STOPS - 1 ? "More settings" : "Fewer settings");
  }
}
