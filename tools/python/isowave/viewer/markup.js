// markup.js -- the elements of a view, and how they look. A part of an ES module (front_end.py).

const THUMB = 12; // width of the slider's thumb, CSS pixels

const HTML = `
<div class="frame starting">
  <section class="stage" aria-label="Picture">
    <canvas class="picture" tabindex="0" role="application" aria-describedby="keys"
      aria-label="Isosurface; arrow keys turn it"></canvas>
    <div class="bar" aria-hidden="true"></div>
    <p class="note" role="alert" hidden></p>
    <button class="toggle" type="button" aria-controls="panel" aria-expanded="true">Panel</button>
  </section>
${TIME_ROW}
  <section class="iso" aria-label="Isovalue">
    <label class="number">Isovalue
      <input name="isovalue" type="number" step="any" min="-3.4e38" max="3.4e38" required></label>
    <div class="histogram">
      <canvas aria-hidden="true"></canvas>
      <input name="slider" type="range" aria-label="Isovalue on the histogram" min="0" max="1">
      <div class="ends" aria-hidden="true">
        <span></span><span>voxels, log scale</span><span></span></div>
    </div>
  </section>
  <aside class="panel" id="panel" aria-label="Settings">
    <h1></h1><p class="volume"></p>
    <div class="buttons">
      <button type="button" name="reset">Reset view</button>
      <button type="button" name="shot">Screenshot</button>
      <button type="button" name="copy">Copy camera</button>
      <button type="button" name="paste" aria-expanded="false">Paste camera</button>
      <button type="button" name="save_scene">Save scene</button>
      <button type="button" name="open_scene">Open scene</button>
      <input name="scene_file" type="file" accept=".json" aria-label="Scene file" hidden>
    </div>
    <form class="paste" hidden>
      <label>Camera file (JSON)
        <textarea name="camera" rows="4" spellcheck="false"></textarea></label>
      <p class="problem" role="alert"></p>
      <div class="buttons">
        <button>Use it</button><button type="button" name="cancel">Cancel</button></div>
    </form>
    <h2>Surfaces</h2>
    <ol class="surfaces" aria-label="Surfaces"></ol>
    <div class="buttons"><button type="button" name="add">Add surface</button></div>
    ${LABEL_ROWS}
    ${LOOK_ROWS}
    <h2>Clip</h2>${CLIP_ROWS}
    <p class="planes" hidden><span></span> <button type="button" name="drop_planes">Remove</button>
    </p>
    <label title="Flat caps where the volume is cut; otherwise cuts show the surface from within">
      Caps <input name="caps" type="checkbox"></label>
    <h2>Slices</h2>${SLICE_ROWS}
    <h2>Annotations</h2>${ANNOTATION_ROWS}
    <h2>Quality</h2>${QUALITY_ROWS}
    <h2>Device</h2>
    <form class="budget"><label>Memory budget <span class="unit"><input name="budget" type="number"
      min="1"
      max="9000000" step="1" placeholder="default"> MiB</span></label></form>
    <dl class="device"></dl>
    <h2>This picture</h2>
    <dl class="facts"></dl>
    <details><summary>Keys and gestures</summary><p id="keys">Drag, one finger or arrow keys: turn.
      Right drag, shift and drag, two fingers or shift and arrows: move. Wheel, pinch, + and −:
      zoom. 1, 3, 7: front, right, top;
      9: the opposite side. 0 or double click: reset. The keys work while the picture has the
      focus.</p></details>
  </aside>
  <p class="said" role="status"></p>
</div>`;

const CSS = `
:host { display: block; container-type: size; position: relative; overflow: hidden;
  --back: light-dark(#f3f4f6, #14171a); --card: light-dark(#ffffff, #1b1f24);
  --text: light-dark(#1b2128, #e5e9ed); --soft: light-dark(#55606b, #a2adb8);
  --line: light-dark(#d9dde2, #30363d); --edge: light-dark(#7c8791, #7d8894);
  --field: light-dark(#ffffff, #14171a); --accent: light-dark(#0b63a5, #74b7f0);
  --bars: light-dark(#9aa5b1, #5c6873); --bad: light-dark(#a3231c, #ff9d92);
  color: var(--text); background: var(--back); color-scheme: light dark;
  font: 13px/1.45 system-ui, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
* { box-sizing: border-box; }
[hidden] { display: none !important; }
.frame { display: grid; height: 100%; grid: minmax(0, 1fr) auto auto / minmax(0, 1fr) auto;
  grid-template-areas: "stage panel" "time panel" "iso panel"; }
.stage { grid-area: stage; position: relative; min-height: 0; }
.picture { position: absolute; inset: 0; width: 100%; height: 100%; touch-action: none;
  cursor: grab; }
.picture:active { cursor: grabbing; }
.bar { position: absolute; inset: 0 auto auto 0; height: 2px; width: 0; background: var(--accent);
  opacity: 0; transition: width .15s, opacity .3s .2s; }
.bar.busy { opacity: 1; }
.note { position: absolute; left: 12px; bottom: 12px; max-width: calc(100% - 24px); margin: 0;
  padding: 8px 12px; border: 1px solid var(--edge); border-radius: 6px; background: var(--card); }
.toggle { position: absolute; top: 10px; right: 10px; }
.time { grid-area: time; display: flex; gap: 16px; align-items: start; padding: 8px 16px 4px;
  background: var(--card); border-top: 1px solid var(--line); }
.time button { flex: none; width: 36px; padding: 0; }
.time svg { display: block; margin: auto; }
.time [aria-pressed=true] .off, .time [aria-pressed=false] .on { display: none; }
.time > div { flex: 1; min-width: 0; }
.time input { display: block; width: 100%; height: 20px; margin: 0; accent-color: var(--accent); }
.steps { display: flex; justify-content: space-between; gap: 12px; color: var(--soft);
  font-size: 11px; font-variant-numeric: tabular-nums; }
.steps output { min-width: 0; overflow-wrap: anywhere; text-align: center; }
.iso { grid-area: iso; display: flex; gap: 16px; align-items: start; padding: 10px 16px 8px;
  background: var(--card); border-top: 1px solid var(--line); }
.iso .number { display: block; width: 104px; flex: none; }
.iso .number input { width: 100%; margin-top: 2px; }
.histogram { position: relative; flex: 1; min-width: 0; }
.histogram canvas { color: var(--accent); outline: 0 solid var(--bars); display: block;
  width: 100%; height: 44px; }
.histogram input { position: absolute; inset: 0 0 auto; width: 100%; height: 44px; margin: 0;
  appearance: none; background: none; cursor: ew-resize; border-radius: 3px; }
.histogram input::-webkit-slider-thumb { appearance: none; width: ${THUMB}px; height: 44px;
  background: linear-gradient(var(--accent), var(--accent)) center / 2px 100% no-repeat,
    radial-gradient(circle at 50% 50%, var(--accent) 5px, transparent 5.8px); }
.histogram input::-moz-range-thumb { width: ${THUMB}px; height: 44px; border: 0; border-radius: 0;
  background: linear-gradient(var(--accent), var(--accent)) center / 2px 100% no-repeat,
    radial-gradient(circle at 50% 50%, var(--accent) 5px, transparent 5.8px); }
.ends { display: flex; justify-content: space-between; padding: 0 ${THUMB / 2}px;
  color: var(--soft); font-size: 11px;
  font-variant-numeric: tabular-nums; }
.panel { grid-area: panel; width: 268px; padding: 12px 14px; overflow: auto;
  background: var(--card); border-left: 1px solid var(--line); }
.panel h1 { margin: 0; font-size: 14px; font-weight: 600; overflow-wrap: anywhere; }
.panel h2 { margin: 14px 0 4px; font-size: 11px; font-weight: 600; color: var(--soft);
  letter-spacing: .04em; text-transform: uppercase; }
.volume { margin: 0 0 10px; color: var(--soft); font-size: 12px; }
.panel label { display: flex; justify-content: space-between; align-items: center; gap: 8px;
  min-height: 30px; }
.panel select { flex: none; width: 108px; }
.panel label > input[type=text] { flex: none; width: 108px; }
.panel input[type=color] { flex: none; width: 76px; margin-right: 32px; }
.surfaces { list-style: none; margin: 0 0 6px; padding: 0; }
.surfaces li { display: flex; align-items: center; gap: 4px; min-height: 32px; padding: 0 4px;
  margin: 0 -7px; border-left: 3px solid transparent; }
.surfaces li[aria-current] { border-color: var(--accent); background: var(--back); }
.surfaces input { min-width: 0; }
.panel .surfaces input[type=color] { width: 30px; margin: 0; }
.panel .surfaces input:is([type=number], [type=text]) { flex: 0 0 68px; width: 68px;
  padding: 0 5px; }
.surfaces input[type=range] { flex: 1; accent-color: var(--accent); }
.surfaces button { flex: none; width: 28px; padding: 0; }
.groups ~ .buttons { margin-bottom: 8px; }
.hint { margin: 0 0 4px; color: var(--soft); font-size: 12px; }
[inert] { opacity: .45; }
.surfaces svg { display: block; margin: auto; }
.surfaces [aria-pressed=true] .off { display: none; }
:disabled { opacity: .45; cursor: default; }
.slices { list-style: none; margin: 0 0 6px; padding: 0; }
.slices li { display: grid; grid-template-columns: 1ch minmax(0, 1fr) 76px 28px; gap: 0 6px;
  align-items: center; padding: 4px 0; }
.slices input { min-width: 0; width: 100%; margin: 0; }
.slices input[type=range] { accent-color: var(--accent); }
.slices button { padding: 0; }
.slices div { grid-column: 2 / -1; display: flex; align-items: center; gap: 6px; min-height: 30px;
  color: var(--soft); font-size: 12px; }
.panel .slices label { flex: none; min-height: 0; gap: 4px; }
.panel .slices input[type=checkbox] { width: auto; margin: 0; }
.clip { display: flex; align-items: center; gap: 8px; min-height: 30px; }
.clip span { width: 1ch; }
.planes { display: flex; justify-content: space-between; align-items: center; margin: 0;
  min-height: 30px; }
.clip div { position: relative; flex: 1; height: 20px; background: linear-gradient(var(--bars),
  var(--bars)) center / calc(100% - ${THUMB}px) 2px no-repeat; }
.clip input { position: absolute; inset: 0; width: 100%; height: 20px; margin: 0;
  appearance: none; background: none; border-radius: 3px; pointer-events: none; }
.clip input::-webkit-slider-thumb { appearance: none; width: ${THUMB}px; height: ${THUMB}px;
  border-radius: 50%; background: var(--accent); cursor: ew-resize; pointer-events: auto; }
.clip input::-moz-range-thumb { width: ${THUMB}px; height: ${THUMB}px; border: 0;
  border-radius: 50%; background: var(--accent); cursor: ew-resize; pointer-events: auto; }
.buttons { display: grid; grid-template-columns: 1fr 1fr; gap: 6px; }
.thirds { grid-template-columns: 1fr 1fr 1fr; margin-bottom: 4px; }
.paste { margin-top: 8px; }
.paste label { display: block; }
.problem { margin: 4px 0; color: var(--bad); }
button, input, select, textarea { font: inherit; color: inherit; }
button, input[type=number], input[type=text], select, textarea {
  border: 1px solid var(--edge); border-radius: 4px;
  background: var(--field); padding: 0 8px; height: 28px; }
button { cursor: pointer; background: var(--card); white-space: nowrap; }
button:hover { border-color: var(--accent); color: var(--accent); }
.unit { display: grid; grid-template-columns: 76px 26px; align-items: center; gap: 6px; }
.panel input[type=number] { width: 100%; text-align: right; appearance: textfield; }
input::-webkit-inner-spin-button { display: none; }
input::placeholder { color: var(--soft); opacity: 1; }
.panel input[type=checkbox] { margin: 0 32px 0 0; }
input[type=color] { height: 26px; padding: 2px; border: 1px solid var(--edge);
  border-radius: 4px; background: var(--field); cursor: pointer; }
.frame:not(.starting) input:invalid { border-color: var(--bad); outline-color: var(--bad); }
textarea { width: 100%; height: auto; padding: 4px 8px; resize: vertical;
  font: 12px/1.4 ui-monospace, monospace; }
:focus-visible { outline: 2px solid var(--accent); outline-offset: 2px; }
.picture:focus-visible, .histogram input:focus-visible { outline-offset: -2px; }
dl { display: grid; grid-template-columns: auto 1fr; gap: 2px 10px; margin: 4px 0; }
dt { color: var(--soft); }
dd { margin: 0; text-align: right; overflow-wrap: anywhere; font-variant-numeric: tabular-nums; }
details { margin-top: 14px; color: var(--soft); font-size: 12px; }
summary { cursor: pointer; }
.said { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%);
  margin: 0; }
.closed .panel { display: none; }
@container (max-width: 640px) {
  .frame { overflow: auto; grid: minmax(220px, 1fr) auto auto auto / minmax(0, 1fr);
    grid-template-areas: "stage" "time" "iso" "panel"; }
  .frame:not(.closed) { grid-template-rows: max(220px, 55cqh) auto auto auto; }
  .time { gap: 10px; padding: 6px 10px; }
  .iso { gap: 10px; padding: 8px 10px; }
  .iso .number { width: 84px; }
  .panel { width: auto; border: 0; border-top: 1px solid var(--line); overflow: visible; }
}
@media (pointer: coarse) { button, input[type=number], select { height: 36px; }
  .panel label, .surfaces li { min-height: 40px; } }
@media (prefers-reduced-motion: reduce) { * { transition: none !important; } }
`;
