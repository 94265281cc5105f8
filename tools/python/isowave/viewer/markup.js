// markup.js -- the elements of a view. A part of an ES module (front_end.py).

const UNDO = icon("M6 3 2 6l4 3M2 6h8a4 4 0 0 1 0 8H7");
const REDO = icon("m10 3 4 3-4 3M14 6H6a4 4 0 0 0 0 8h3");
const PANEL = icon("M2 3h12v10H2zM10 3v10");

/** HTML of a button of the top bar and what it opens. */
const menu = (name, button, label, content) => `
  <div class="menu ${name}"><button type="button" name="${name}_menu" aria-expanded="false"
    aria-controls="${name}_pop">${button}</button>
    <div class="pop" id="${name}_pop" role="group" aria-label="${label}" hidden>${content}</div>
  </div>`;

const FILE_POP = `<p class="volume"></p>
    <div class="buttons">
      <button type="button" name="open_scene">Open scene</button>
      <button type="button" name="save_scene">Save scene</button></div>
    <input name="scene_file" type="file" accept=".json" aria-label="Scene file" hidden>
    <div class="recent" hidden><h2>Recent scenes</h2><ul></ul></div>
    <p class="hint">Scene files can be dropped on the picture. Another volume:
      <code>isowave view FILE</code></p>`;
const CAMERA_POP = `
    <div class="buttons thirds">${VIEW_BUTTONS}</div>
    <div class="buttons">
      <button type="button" name="roll_left">Roll left</button>
      <button type="button" name="roll_right">Roll right</button>
      <button type="button" name="copy">Copy camera</button>
      <button type="button" name="paste" aria-expanded="false">Paste camera</button></div>
    <form class="paste" hidden>
      <label>Camera file (JSON)
        <textarea name="camera" rows="4" spellcheck="false"></textarea></label>
      <p class="problem" role="alert"></p>
      <div class="buttons">
        <button>Use it</button><button type="button" name="cancel">Cancel</button></div>
    </form>`;
const HELP_POP = `<p id="keys">Drag, one finger or arrow keys: turn.
      Right drag, shift and drag, two fingers or shift and arrows: move. Wheel, pinch, + and −:
      zoom to the cursor. Alt and drag, a twist of two fingers, Q and E: roll. Double click: turn
      about what is there. R or 0: reset. 1, 3, 7: front, right, top; 9: the opposite side.
      Ctrl+Z, Ctrl+Y: undo, redo. Esc: close, let go of a tool.</p>`;

const HTML = `
<div class="frame starting">
  <div class="top" role="group" aria-label="File and camera">
    <h1 class="brand">isowave</h1>
    ${menu("file", '<span class="title">isowave</span>', "File", FILE_POP)}
    <span class="gap"></span>
    <button type="button" name="undo" aria-label="Undo" title="Undo (Ctrl+Z)">${UNDO}</button>
    <button type="button" name="redo" aria-label="Redo" title="Redo (Ctrl+Y)">${REDO}</button>
    <button type="button" name="share" title="Copies the address of this view">Share</button>
    ${menu("camera", "Camera", "Camera", CAMERA_POP)}
    ${menu("export", "Export", "Export", EXPORT_POP)}
    ${menu("info", '<span aria-hidden="true">i</span><span class="said">Details</span>', "Details",
    '<h2>Device</h2><dl class="device"></dl><h2>This picture</h2><dl class="facts"></dl>')}
    ${menu("help", '<span aria-hidden="true">?</span><span class="said">Keys and gestures</span>',
    "Keys and gestures", HELP_POP)}
    <button class="toggle" type="button" aria-controls="panel" aria-expanded="true"
      aria-label="Panel" title="Panel">${PANEL}</button>
  </div>
  <section class="stage" aria-label="Picture">
    <canvas class="picture" tabindex="0" role="application" aria-describedby="keys"
      aria-label="Isosurface; arrow keys turn it"></canvas>
    <svg class="overlay" aria-hidden="true"></svg>
    <div class="bar" aria-hidden="true"></div>
    ${TOOL_STRIP}
    ${CUBE}
    <div class="below" aria-hidden="true"><div class="scale"><i></i><span></span></div>
      <p class="certain"></p><p class="readout"></p></div>
    <p class="work" hidden></p>
    <p class="note" role="alert" hidden></p>
  </section>
  <div class="sheet">
  <button class="grip" type="button" aria-label="More settings"></button>
  ${HISTOGRAM_ROW}
  ${TIME_ROW}
  <section class="panel" id="panel" aria-label="Settings">
    <h2>Surfaces</h2>
    <ol class="surfaces" aria-label="Surfaces"></ol>
    <div class="buttons"><button type="button" name="add">Add surface</button>
      <select name="peak" aria-label="Add at peak"></select></div>
    ${LABEL_ROWS}
    <h2>Cut</h2>
    <h3>Box</h3>${CLIP_ROWS}
    <h3>Planes</h3>${PLANE_ROWS}
    <label title="Flat caps where the volume is cut; otherwise cuts show the surface from within">
      Caps <input name="caps" type="checkbox"></label>
    <h3>Slices</h3>${SLICE_ROWS}
    <h2>Colour</h2>${COLOUR_ROWS}
    <h2>Look</h2>${PRESET_ROWS}
    <label>Background <input name="background" type="color"></label>
    <details><summary>Light and background</summary>${LIGHT_ROWS}</details>
    <details><summary>Annotations</summary>${ANNOTATION_ROWS}</details>
    <details><summary>Advanced</summary>${QUALITY_ROWS}
    <form class="budget"><label title="Most memory for this volume, for all who look at it">
      Device memory <span class="unit"><input name="budget" type="number" min="1"
      max="9000000" step="1" placeholder="default"> MiB</span></label></form></details>
  </section>
  </div>
  <p class="said" role="status"></p>
</div>`;
