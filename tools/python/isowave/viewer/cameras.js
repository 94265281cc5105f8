// cameras.js -- the camera's menu: copying and pasting, rolling. A part of an ES module
// (front_end.py).

/** The camera's menu. Views are the cube's. */
class Cameras {
  /** @param {View} view whose camera it is */
  constructor(view) {
    this.view = view;
    this.form = view.find("form.paste");
  }

  listen(on) {
    const { view, form } = this;
    on(view.field("roll_left"), "click", () => view.move((c) => roll(c, -Math.PI / 12)));
    on(view.field("roll_right"), "click", () => view.move((c) => roll(c, Math.PI / 12)));
    on(view.field("copy"), "click", () => this.copy());
    on(view.field("paste"), "click", () => this.openPaste(form.hidden));
    on(view.field("cancel"), "click", () => this.openPaste(false));
    on(form, "submit", (e) => {
      e.preventDefault();
      if (this.paste(view.field("camera").value)) this.openPaste(false);
    });
    on(view.root, "copy", (e) => this.onClipboard(e, () =>
      e.clipboardData.setData("text/plain", this.text)));
    on(view.root, "paste", (e) => this.onClipboard(e, () =>
      this.paste(e.clipboardData.getData("text/plain"))));
  }

  onClipboard(event, act) {
    if (this.view.root.activeElement !== this.view.picture) return;
    event.preventDefault();
    act();
  }

  get text() {
    const { state, picture } = this.view;
    return writeCamera(state.camera, picture.width, picture.height);
  }

  async copy() {
    const { view } = this;
    if (!view.state.camera) return;
    if (await view.copyText(this.text, "copy")) return;
    this.openPaste(true); // no access to the clipboard: there it can be copied by hand
    view.field("camera").value = this.text;
    view.field("camera").select();
  }

  openPaste(open) {
    const { view } = this;
    this.form.hidden = !open;
    view.field("paste").setAttribute("aria-expanded", open);
    view.find(".problem").textContent = "";
    view.field(open ? "camera" : "paste").focus();
  }

  /** @returns {boolean} whether there was something to close */
  closePaste() {
    const isOpen = this.form.contains(this.view.root.activeElement);
    if (isOpen) this.openPaste(false);
    return isOpen;
  }

  /** @returns {boolean} whether it was a camera */
  paste(text) {
    const { view } = this;
    try {
      view.history.hold(false);
      view.change({ camera: readCamera(text) });
      return true;
    } catch (error) {
      if (this.form.hidden || view.find("#camera_pop").hidden) view.note(error.message, "error");
      view.find(".problem").textContent = error.message;
      return false;
    }
  }
}
