// time.js -- the steps of a series: a slider under the picture, and a button that plays them. A
// part of an ES module (front_end.py).

const PLAY_MS = 100; // least time of a step
const READING_MS = 500; // without a picture of another step, until the page says that it is read
const MAX_STEP_WAIT_MS = 1000; // for a picture of another step, before the next wish is sent

const PLAY = `<svg viewBox="0 0 16 16" width="16" height="16" fill="currentColor"
  aria-hidden="true"><path class="off" d="M4 2v12l9-6z"/>
  <path class="on" d="M3 2h4v12H3zM9 2h4v12H9z"/></svg>`;
/** HTML of the slider. */
const TIME_ROW = `
  <section class="time" aria-label="Steps" hidden>
    <button type="button" name="play" aria-pressed="false" aria-label="Play"
      title="Shows the steps in turn, again and again">${PLAY}</button>
    <div><input name="step" type="range" min="0" step="1" aria-label="Step">
      <div class="steps" aria-hidden="true"><span>0</span><output></output><span></span></div></div>
  </section>`;

/** The steps of a series, and which one is shown. */
class Timeline {
  /** @param {View} view whose state has the step */
  constructor(view) {
    this.view = view;
    /** @type {string[]} */
    this.names = [];
    this.sent = this.shown = 0; // steps of the last wish, and of the last picture
    this.isPlaying = false;
    this.playing = this.reading = 0; // timers
    this.begun = -Infinity; // when the last step was wished for
  }

  listen(on) {
    const { view } = this;
    on(view.field("step"), "input", ({ target }) => {
      view.change({ step: Number(target.value) });
      this.play(false);
    });
    on(view.field("play"), "click", () => this.play(!this.isPlaying));
    on(view.ended.signal, "abort", () => {
      for (const timer of [this.playing, this.reading]) clearTimeout(timer);
    });
  }

  /** A volume or a series has come. */
  welcome({ steps }) {
    const { view } = this;
    this.names = steps ?? [];
    view.find(".time").hidden = this.names.length < 2;
    view.field("step").max = Math.max(0, this.names.length - 1);
    const isSeries = this.names.length > 1;
    view.find("output + span").textContent = this.names.length - 1;
    if (isSeries) view.find(".volume").append(`, ${this.names.length} steps`);
    view.histogram.note = isSeries ? "voxels of step 0" : "voxels";
  }

  /** The step of a wish, which the series has. */
  get step() {
    return clamp(this.view.state.step, 0, Math.max(0, this.names.length - 1));
  }

  /** Time for a picture of the last wish, before the next one is sent [ms]. */
  get patience() {
    return this.sent === this.shown ? MAX_IN_WAIT_MS : MAX_STEP_WAIT_MS;
  }

  show() {
    const { view, names } = this;
    if (view.volume) view.state.step = this.step; // an address may have another one
    const { step } = this;
    const name = names[step] ?? "";
    view.field("step").value = step;
    view.field("step").setAttribute("aria-valuetext", `${step}, ${name}`);
    view.find("output").textContent = `step ${step}: ${name}`;
    view.field("play").setAttribute("aria-pressed", this.isPlaying);
  }

  /** Plays from the step at hand, or stops. */
  play(isPlaying) {
    this.isPlaying = isPlaying;
    clearTimeout(this.playing);
    this.playing = 0;
    if (isPlaying) this.goOn();
    this.show();
  }

  goOn() {
    this.playing = 0;
    this.view.change({ step: (this.step + 1) % this.names.length });
  }

  /** A wish was sent. */
  wished() {
    if (this.step !== this.sent) this.begun = performance.now();
    this.sent = this.step;
    clearTimeout(this.reading);
    if (this.sent === this.shown) return;
    this.reading = setTimeout(() =>
      this.view.note(`Reading step ${this.sent} …`, "drawing"), READING_MS);
  }

  /**
   * A picture of the newest wish is shown, or none can be drawn.
   * @param {boolean} isWhole
   */
  came(isWhole) {
    clearTimeout(this.reading);
    this.shown = this.sent;
    const isMoving = this.step !== this.sent; // the wish for the next step is about to be sent
    if (!isWhole || !this.isPlaying || this.playing || isMoving) return;
    const left = PLAY_MS - (performance.now() - this.begun);
    this.playing = setTimeout(() => this.goOn(), Math.max(0, left));
  }
}
