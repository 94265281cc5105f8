// styles.js -- how the elements of a view look. A part of an ES module (front_end.py).

const thumb = (rules) => `::-webkit-slider-thumb { appearance: none; ${rules} }`;
const both = (selector, rules) => `${selector}${thumb(rules)}
${selector}::-moz-range-thumb { border: 0; ${rules} }`;

const CSS = `
:host { display: block; container-type: size; position: relative; overflow: hidden;
  --back: light-dark(#f3f4f6, #14171a); --card: light-dark(#ffffff, #1b1f24);
  --text: light-dark(#1b2128, #e5e9ed); --soft: light-dark(#55606b, #a2adb8);
  --line: light-dark(#d9dde2, #30363d); --edge: light-dark(#7c8791, #7d8894);
  --field: light-dark(#ffffff, #14171a); --accent: light-dark(#0b63a5, #74b7f0);
  --bars: light-dark(#9aa5b1, #5c6873); --bad: light-dark(#a3231c, #ff9d92);
  --high: light-dark(#e4eef7, #23364a); --shade: 0 2px 12px light-dark(#1b212833, #000a);
  color: var(--text); background: var(--back); color-scheme: light dark;
  font: 13px/1.45 system-ui, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
* { box-sizing: border-box; }
[hidden] { display: none !important; }
.frame { display: grid; height: 100%; grid: auto minmax(0, 1fr) auto auto / minmax(0, 1fr) auto;
  grid-template-areas: "top top" "stage panel" "iso iso" "time time"; }
.sheet { display: contents; }
.grip { display: none; }
.icon { display: block; margin: auto; fill: none; stroke: currentColor; stroke-width: 1.4;
  stroke-linecap: round; stroke-linejoin: round; }

.top { grid-area: top; display: flex; align-items: center; gap: 4px; min-height: 40px;
  padding: 0 8px 0 12px; background: var(--card); border-bottom: 1px solid var(--line);
  z-index: 3; }
.brand { color: var(--soft); font-size: inherit; font-weight: 600; letter-spacing: .01em;
  margin: 0 4px 0 0; }
.gap { flex: 1; }
.top button { border-color: transparent; min-width: 30px; }
.top button:hover, .top [aria-expanded=true] { background: var(--high); }
.top > button, .menu > button { padding: 0 8px; }
.menu { position: relative; flex: none; }
.menu.file { flex: 0 1 auto; min-width: 0; }
.menu.file > button { display: flex; align-items: center; max-width: 100%; font-weight: 600; }
.file > button::after, .camera > button::after, .export > button::after { content: " ▾";
  white-space: pre; color: var(--soft); }
.title { overflow: hidden; text-overflow: ellipsis; }
.pop { position: absolute; top: calc(100% + 6px); right: 0; width: 290px; padding: 12px;
  max-height: calc(100cqh - 56px); overflow: auto; background: var(--card);
  border: 1px solid var(--line); border-radius: 8px; box-shadow: var(--shade); }
.file .pop { right: auto; left: 0; }
.pop button { border-color: var(--edge) !important; }
.pop h2:first-child { margin-top: 0; }
.pop .buttons { margin-bottom: 6px; }
.pop p { margin: 0 0 8px; }
.recent ul { list-style: none; margin: 0 0 8px; padding: 0; }
.recent button { width: 100%; border: 0; text-align: left; overflow: hidden;
  text-overflow: ellipsis; }
code, [name=command] { font: 12px/1.4 ui-monospace, monospace; }

.stage { grid-area: stage; position: relative; min-height: 0; overflow: hidden; }
.picture, .overlay { position: absolute; inset: 0; width: 100%; height: 100%; }
.picture { touch-action: none; cursor: grab; }
.picture:active { cursor: grabbing; }
.picture.aims { cursor: crosshair; }
.overlay { pointer-events: none; }
.overlay path, .overlay line { fill: none; stroke: var(--accent); stroke-width: 1.5; }
.overlay .under { stroke: var(--back); stroke-width: 4; opacity: .7; }
.overlay .face { fill: var(--accent); fill-opacity: .07; stroke-opacity: .7; }
.overlay .handle { pointer-events: all; fill: var(--accent); stroke: var(--card);
  stroke-width: 2; cursor: grab; touch-action: none; }
.overlay text { fill: var(--text); stroke: var(--back); stroke-width: 4; paint-order: stroke;
  font-weight: 600; font-variant-numeric: tabular-nums; }
.bar { position: absolute; inset: 0 auto auto 0; height: 2px; width: 0; background: var(--accent);
  opacity: 0; transition: width .15s, opacity .3s .2s; }
.bar.busy { opacity: 1; }
.tools { position: absolute; left: 8px; top: 50%; transform: translateY(-50%); display: flex;
  flex-direction: column; gap: 2px; padding: 3px; background: var(--card);
  border: 1px solid var(--line); border-radius: 8px; box-shadow: var(--shade); }
.tools button { width: 32px; height: 30px; padding: 0; border-color: transparent; }
.tools [aria-pressed=true] { background: var(--high); color: var(--accent); }
.tools hr { width: 100%; margin: 2px 0; border: 0; border-top: 1px solid var(--line); }
.cube { position: absolute; top: 6px; right: 6px; width: 84px; height: 84px; overflow: visible; }
.cube g { cursor: pointer; }
.cube polygon { fill: var(--card); stroke: var(--edge); stroke-linejoin: round; }
.cube g:hover polygon { fill: var(--high); }
.cube g:focus-visible { outline-offset: 0; }
.cube text { fill: var(--text); font-size: 17px; font-weight: 600; text-anchor: middle;
  pointer-events: none; }
.below { position: absolute; inset: auto 12px 8px 12px; display: flex; align-items: end; gap: 16px;
  pointer-events: none; font-size: 12px; font-variant-numeric: tabular-nums; color: var(--text); }
.below p { margin: 0; padding: 0 6px; border-radius: 4px; background: var(--card); }
.below p:empty { display: none; }
.scale { margin-right: auto; text-align: center; padding: 0 6px 3px; border-radius: 4px;
  background: var(--card); }
.scale i { display: block; height: 5px; border: solid currentColor; border-width: 0 1.5px 1.5px; }
.scale span { display: block; line-height: 1.3; }
.work { position: absolute; top: 10px; left: 50%; transform: translateX(-50%); margin: 0;
  padding: 3px 10px; border-radius: 12px; background: var(--card); color: var(--soft);
  font-size: 12px; font-variant-numeric: tabular-nums; }
.note { position: absolute; left: 50%; bottom: 40px; transform: translateX(-50%);
  width: max-content; max-width: min(560px, calc(100% - 24px)); margin: 0;
  padding: 8px 12px; border: 1px solid var(--edge); border-radius: 6px; background: var(--card); }
.drops .picture { outline: 3px dashed var(--accent); outline-offset: -6px; }

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
.iso { grid-area: iso; display: flex; gap: 14px; align-items: start; padding: 8px 12px 6px;
  background: var(--card); border-top: 1px solid var(--line); }
.iso .number { display: block; width: 104px; flex: none; }
.iso .number input { width: 100%; margin-top: 2px; }
.histogram { position: relative; flex: 1; min-width: 0; }
.histogram canvas { color: var(--accent); outline: 0 solid var(--bars); display: block;
  width: 100%; height: 44px; cursor: ew-resize; touch-action: none; }
.histogram .handles input { position: absolute; inset: 0 0 auto; width: 100%; height: 44px;
  margin: 0; appearance: none; background: none; border-radius: 3px; pointer-events: none; }
${both(".handles input", `width: ${THUMB}px; height: 44px; border-radius: 0; cursor: ew-resize;
  pointer-events: auto; background:
    radial-gradient(circle, var(--c) 4.2px, var(--text) 4.6px 5.4px, transparent 6px),
    linear-gradient(var(--text), var(--text)) center / 3.5px 100% no-repeat;`)}
.handles [data-other]${thumb("opacity: .75;")}
.ticks button { position: absolute; top: -4px; width: 12px; height: 12px; min-width: 0;
  margin-left: -6px; padding: 0; border: 0; background: var(--accent);
  clip-path: polygon(15% 0, 85% 0, 50% 75%); }
.ends { display: flex; justify-content: space-between; padding: 0 ${THUMB / 2}px;
  color: var(--soft); font-size: 11px; font-variant-numeric: tabular-nums; }
.scales { display: grid; grid-template-columns: 44px 30px; gap: 4px; flex: none; }
.scales button { padding: 0; height: 24px; font-size: 12px; }
[aria-pressed=true].flag { background: var(--high); color: var(--accent); }

.panel { grid-area: panel; width: 272px; padding: 2px 14px 14px; overflow: auto;
  background: var(--card); border-left: 1px solid var(--line); }
.closed .panel { display: none; }
h2 { margin: 14px 0 4px; font-size: 11px; font-weight: 600; color: var(--soft);
  letter-spacing: .06em; text-transform: uppercase; }
h3 { margin: 6px 0 2px; font-size: 12px; font-weight: 600; color: var(--soft); }
.volume { color: var(--soft); font-size: 12px; }
.panel label, .pop label { display: flex; justify-content: space-between; align-items: center;
  gap: 8px; min-height: 30px; }
.panel select { flex: none; width: 108px; }
.panel label > input[type=text] { flex: none; width: 108px; }
.panel input[type=color] { flex: none; width: 76px; margin-right: 32px; }
.segments { display: flex; margin: 2px 0 6px; border: 1px solid var(--edge); border-radius: 6px;
  overflow: hidden; }
.panel .segments label, .pop .segments label { position: relative; flex: 1;
  justify-content: center; min-height: 28px; padding: 0 4px; }
.segments label + label { border-left: 1px solid var(--edge); }
.segments input { position: absolute; inset: 0; margin: 0; opacity: 0; cursor: pointer; }
.segments label:has(:checked) { background: var(--high); color: var(--accent);
  font-weight: 600; }
.segments label:has(:disabled) { color: var(--soft); text-decoration: line-through; }
.segments label:has(:focus-visible) { outline: 2px solid var(--accent); outline-offset: -2px; }
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
.panel .buttons select { width: 100%; }
.groups ~ .buttons { margin-bottom: 8px; }
.hint { margin: 0 0 4px; color: var(--soft); font-size: 12px; }
[inert] { opacity: .45; }
.surfaces svg { display: block; margin: auto; }
.surfaces [aria-pressed=true] .off { display: none; }
:disabled { opacity: .45; cursor: default; }
.slices, .plane_list { list-style: none; margin: 0 0 6px; padding: 0; }
.slices li, .plane_list li { display: grid; gap: 0 6px; align-items: center; padding: 4px 0;
  grid-template-columns: 1ch minmax(0, 1fr) 68px 28px 28px; }
.slices li { grid-template-columns: 1ch minmax(0, 1fr) 76px 28px; }
.slices input, .plane_list input { min-width: 0; width: 100%; margin: 0; }
.slices input[type=range], .plane_list input[type=range] { accent-color: var(--accent); }
.slices button, .plane_list button { padding: 0; }
.slices div { grid-column: 2 / -1; display: flex; align-items: center; gap: 6px; min-height: 30px;
  color: var(--soft); font-size: 12px; }
.panel .slices label { flex: none; min-height: 0; gap: 4px; }
.panel .slices input[type=checkbox] { width: auto; margin: 0; }
.clip { display: flex; align-items: center; gap: 8px; min-height: 28px; }
.clip span { width: 1ch; }
.clip div { position: relative; flex: 1; height: 20px; background: linear-gradient(var(--bars),
  var(--bars)) center / calc(100% - ${THUMB}px) 2px no-repeat; }
.clip input { position: absolute; inset: 0; width: 100%; height: 20px; margin: 0;
  appearance: none; background: none; border-radius: 3px; pointer-events: none; }
${both(".clip input", `width: ${THUMB}px; height: ${THUMB}px; border-radius: 50%;
  background: var(--accent); cursor: ew-resize; pointer-events: auto;`)}
.buttons { display: grid; grid-template-columns: 1fr 1fr; gap: 6px; }
.thirds { grid-template-columns: 1fr 1fr 1fr; margin-bottom: 4px; }
.paste { margin-top: 8px; }
.pop .paste label { display: block; }
.problem { margin: 4px 0; color: var(--bad); }
button, input, select, textarea { font: inherit; color: inherit; }
button, input[type=number], input[type=text], select, textarea {
  border: 1px solid var(--edge); border-radius: 5px;
  background: var(--field); padding: 0 8px; height: 28px; }
button { cursor: pointer; background: var(--card); white-space: nowrap; }
button:hover:not(:disabled) { border-color: var(--accent); color: var(--accent); }
.unit { display: grid; grid-template-columns: 76px 26px; align-items: center; gap: 6px; }
.panel input[type=number] { width: 100%; text-align: right; appearance: textfield; }
input::-webkit-inner-spin-button { display: none; }
input::placeholder { color: var(--soft); opacity: 1; }
.panel input[type=checkbox] { margin: 0 32px 0 0; }
input[type=color] { height: 26px; padding: 2px; border: 1px solid var(--edge);
  border-radius: 5px; background: var(--field); cursor: pointer; }
.frame:not(.starting) input:invalid { border-color: var(--bad); outline-color: var(--bad); }
textarea { width: 100%; height: auto; padding: 4px 8px; resize: vertical;
  font: 12px/1.4 ui-monospace, monospace; }
:focus-visible { outline: 2px solid var(--accent); outline-offset: 2px; }
.picture:focus-visible, .histogram input:focus-visible { outline-offset: -2px; }
dl { display: grid; grid-template-columns: auto 1fr; gap: 2px 10px; margin: 4px 0; }
dt { color: var(--soft); }
dd { margin: 0; text-align: right; overflow-wrap: anywhere; font-variant-numeric: tabular-nums; }
details { margin-top: 10px; border-top: 1px solid var(--line); padding-top: 8px; }
summary { cursor: pointer; color: var(--soft); font-weight: 600; font-size: 12px; }
.said { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%);
  margin: 0; }

@container (max-height: 440px) {
  .top { min-height: 34px; }
  .histogram canvas, .handles input { height: 30px !important; }
  ${both(".handles input", "height: 30px;")}
  .tools button { height: 26px; }
  .cube { width: 64px; height: 64px; }
  .iso { padding: 6px 12px 3px; }
  .below { left: 64px; }
}
@container (max-width: 760px) {
  .brand { position: absolute; clip-path: inset(50%); }
  .top [name=share] { display: none; }
  .panel { width: 248px; }
}
@container (max-width: 640px) {
  .frame { grid: auto minmax(0, 1fr) / minmax(0, 1fr); grid-template-areas: "top" "stage"; }
  .top { padding: 0 4px; gap: 0; }
  .menu { position: static; }
  .top > button, .menu > button { padding: 0 5px; min-width: 26px; }
  .camera > button::after, .export > button::after { content: none; }
  .pop, .file .pop { inset: 44px 8px auto; width: auto; }
  .sheet { display: flex; flex-direction: column; position: absolute; inset: auto 0 0;
    z-index: 2; background: var(--card); border-radius: 14px 14px 0 0;
    box-shadow: var(--shade); overflow: hidden; }
  .grip { display: block; flex: none; width: 100%; height: 22px; border: 0; background: none;
    touch-action: none; cursor: row-resize; }
  .grip::after { content: ""; display: block; width: 40px; height: 4px; margin: auto;
    border-radius: 2px; background: var(--edge); }
  [data-stop="1"] .sheet { height: 52cqh; }
  [data-stop="1"].frame { grid-template-rows: auto calc(48cqh - 32px); align-content: start; }
  [data-stop="2"] .sheet { height: calc(100cqh - 48px); }
  .iso, .time { flex: none; border: 0; padding: 0 10px 6px; gap: 10px; }
  .iso .number { width: 84px; }
  .scales { grid-template-columns: 40px; }
  .scales [name=zoom_out], .scales [name=zoom_in] { display: none; }
  .panel { width: auto; flex: 1; min-height: 0; border: 0; border-top: 1px solid var(--line); }
  .tools { left: 6px; top: 8px; transform: none; }
  .below { bottom: auto; top: 10px; left: 60px; right: 96px; flex-wrap: wrap; gap: 4px; }
  .note { bottom: auto; top: 100px; }
  .readout { display: none; }
}
@media (pointer: coarse) { button, input[type=number], select { height: 36px; }
  .tools button, .scales button { height: 36px; }
  .panel label, .surfaces li { min-height: 40px; } }
@media (prefers-reduced-motion: reduce) { * { transition: none !important; } }
`;
