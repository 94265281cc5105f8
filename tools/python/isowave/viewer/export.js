// export.js -- pictures as files, larger than the page's if one likes, and the command that draws
// the same. A part of an ES module (front_end.py).

const EXPORT_FACTORS = { 1: "1×", 2: "2×", 4: "4×" }; // of the picture's width and height
const MAX_SIDE = 8192; // pixels, as the server has it
/** HTML of what Export opens. */
const EXPORT_POP = `
    ${segments("factor", "Size", EXPORT_FACTORS)}
    <p class="hint export_size"></p>
    <label>Transparent <input name="clear" type="checkbox"></label>
    <label>With a scale bar <input name="with_bar" type="checkbox"></label>
    <div class="buttons"><button type="button" name="shot">Save PNG</button>
      <button type="button" name="stop_export" hidden>Stop</button></div>
    <div class="buttons"><button type="button" name="save_page"
      title="One HTML file that shows this in any browser, without server">Save page</button></div>
    <p class="export_progress" role="status"></p>
    <label for="command">The same picture, by a command</label>
    <textarea id="command" name="command" rows="4" readonly spellcheck="false"></textarea>
    <div class="buttons"><button type="button" name="copy_command">Copy command</button></div>`;

/** A text as a word of a shell. */
export const shellWord = (text) =>
  (/^[\w.,+:@%/-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);

/** The menu of exports. */
class Export {
  /** @param {View} view whose picture is exported */
  constructor(view) {
    this.view = view;
    this.factor = 1;
    this.connection = null; // while a picture is drawn
    check(view, "factor", "1");
  }

  listen(on) {
    const { view } = this;
    on(view.find("[data-name=factor]"), "change", ({ target: { value } }) => {
      this.factor = Number(value);
      this.show();
    });
    for (const name of ["clear", "with_bar"]) on(view.field(name), "change", () => this.show());
    on(view.field("shot"), "click", () => this.start());
    on(view.field("save_page"), "click", () => this.startPage());
    on(view.field("stop_export"), "click", () => this.end("Stopped."));
    on(view.field("copy_command"), "click", async () => {
      if (!await view.copyText(this.command, "copy_command")) view.field("command").select();
    });
    on(view.ended.signal, "abort", () => this.connection?.close());
  }

  /** Width and height of the file [pixels]. */
  get size() {
    const { width, height } = this.view.sizeWished;
    const factor = Math.min(this.factor, MAX_SIDE / Math.max(width, height));
    return [width, height].map((side) => Math.max(1, Math.round(side * factor)));
  }

  get annotations() {
    const { annotations } = this.view.state;
    if (!this.view.field("with_bar").checked || annotations.what.includes("scale-bar")) {
      return annotations;
    }
    return { ...annotations, what: ["scale-bar", ...annotations.what],
      units: this.view.unit };
  }

  get state() {
    return { ...this.view.state, annotations: this.annotations };
  }

  get isClear() {
    return this.view.field("clear").checked;
  }

  /** The file's name: the volume's, the isovalue, the step. */
  get name() {
    const { view } = this;
    const volume = (view.volume?.title || "isowave").replace(/(\.(nii|raw|tar))?\.\w+$/, "");
    const step = view.time.names.length > 1 ? `_step${view.time.shown}` : "";
    const what = drawsLabels(view.state) ? "labels" : toText(view.surface.isovalue);
    const word = volume.replaceAll(/[^\p{L}\p{N}.-]+/gu, "_").replaceAll(/^[_-]+|_+$/g, "");
    return `${word}_${what}${step}.png`;
  }

  /** The command that draws the same picture. */
  get command() {
    const { view, state } = this;
    const { samples, max_error: error, by, ambient, voxel_pixels: voxels } = wishedQuality(state);
    const scene = JSON.parse(writeScene(state, view.backgroundShown(), view.volume));
    if (this.isClear) {
      for (const key of ["background", "background_top"]) delete scene[key];
      scene.transparent = true;
    }
    const file = view.time.names[view.time.step] ?? (view.volume.title || "FILE");
    const volume = scene.volume ? "" : ` ${shellWord(file)}`;
    const options = [
      "--size", this.size.join("x"),
      ...(samples > 1 && !choosesRays(state) ? ["--samples", samples] : []),
      ...(ambient ? ["--ambient", ambient] : []),
      ...(voxels ? ["--voxel-pixels", voxels] : []),
      ...(error && by === "picture" ? ["--max-image-error", error] : []),
      ...(error && by !== "picture" ? ["--max-surface-error", error] : []),
      ...(error && by === "sample" ? ["--by", "sample"] : []),
      "-o", shellWord(this.name),
    ];
    const name = shellWord(this.name.replace(/png$/, "json"));
    return `cat > ${name} << 'END'\n${JSON.stringify(scene)}\nEND\n`
      + `isowave render${volume} --scene ${name} ${options.join(" ")}\n`;
  }

  /** Size and command, as they are now. */
  show() {
    const { view } = this;
    if (!view.volume || !view.state.camera || view.find("#export_pop").hidden) return;
    view.find(".export_size").textContent = this.size.join(" × ");
    view.field("command").value = this.command;
  }

  /** Another connection draws the picture: the page's own stays as it is. */
  start() {
    const { view, name, size, isClear } = this;
    if (!view.volume || !view.state.camera || this.connection) return;
    const wish = view.wishOf(1, size, this.state, isClear);
    this.say("Drawing …");
    const hear = {
      welcome: () => this.connection.send(wish),
      picture: (head, data) => {
        this.connection.send({ type: "ack", frame: head.frame });
        if (head.reduced) this.reduced = head.reduced;
        if (head.stage !== "lossless") return;
        saveAs(new Blob([data], { type: "image/png" }), name);
        this.end(this.reduced ?? `${name} is saved.`);
      },
      progress: ({ percent }) => this.say(`Drawing … ${Math.round(percent)} %`),
      error: ({ message }) => this.end(message),
      closed: ({ message }) => this.end(message),
    };
    this.reduced = null;
    this.connection = view.home.beside((head, data) => hear[head.type]?.(head, data));
    this.connection.send({ type: "hello", version: VERSION });
    this.showStop();
  }

  /** The server writes the page of this scene. */
  startPage() {
    const { view } = this;
    if (!view.volume || !view.state.camera || this.connection) return;
    const text = writeScene(view.state, view.backgroundShown(), view.volume);
    const name = this.name.replace(/png$/, "html");
    this.say("Writing the page …");
    const hear = {
      welcome: () => this.connection.send({ type: "page", text }),
      page: (head, data) => {
        saveAs(new Blob([data], { type: "text/html" }), name);
        this.end(`${name} is saved.`);
      },
      error: ({ message }) => this.end(message),
      closed: ({ message }) => this.end(message),
    };
    this.connection = view.home.beside((head, data) => hear[head.type]?.(head, data));
    this.connection.send({ type: "hello", version: VERSION });
    this.showStop();
  }

  end(text) {
    this.connection?.close();
    this.connection = null;
    this.say(text);
    this.showStop();
  }

  showStop() {
    this.view.field("stop_export").hidden = !this.connection;
    for (const name of ["shot", "save_page"]) {
      this.view.field(name).disabled = this.connection !== null;
    }
  }

  say(text) {
    this.view.find(".export_progress").textContent = text;
  }
}
