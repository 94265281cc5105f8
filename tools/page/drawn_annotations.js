// drawn_annotations.js -- draws annotations over pictures, at the places that the engine gives. A
// part of an ES module (make_page.py).

const ANNOTATION_FONT = "\"DejaVu Sans\", Verdana, system-ui, sans-serif";

const toCss = (color) => `rgb(${color.map((part) => Math.round(255 * part)).join()})`;

/** A canvas, and what draws on it. */
function canvasOf(width, height) {
  const canvas = Object.assign(document.createElement("canvas"), { width, height });
  return canvas.getContext("2d", { willReadFrequently: true });
}

/** A picture in another size. All of it is opaque.
 * @param {Uint8ClampedArray} pixels RGBA */
function resized(pixels, [width, height], [toWidth, toHeight]) {
  const from = canvasOf(width, height);
  from.putImageData(new ImageData(pixels, width, height), 0, 0);
  const to = canvasOf(toWidth, toHeight);
  to.drawImage(from.canvas, 0, 0, toWidth, toHeight);
  return to.getImageData(0, 0, toWidth, toHeight).data;
}

/** A group, as engine.cpp writes it, by itself: halos, boxes, strokes, texts. */
function drawnGroup([begin, end, boxes, strokes, texts, halo, haloColor]) {
  const [width, height] = end.map((side, i) => side - begin[i]);
  const on = canvasOf(width, height);
  on.translate(-begin[0], -begin[1]);
  on.lineJoin = on.lineCap = "round";
  const line = ([points, thick], color, more) => {
    on.beginPath();
    for (const [x, y] of points) on.lineTo(x, y);
    on.strokeStyle = color;
    on.lineWidth = thick + more;
    on.stroke();
  };
  const word = ([[x, y], anchor, size, text], draw) => {
    on.font = `${size}px ${ANNOTATION_FONT}`;
    on.fillStyle = on.strokeStyle;
    on[draw](text, x - anchor * on.measureText(text).width, y);
  };
  for (const stroke of strokes) line(stroke, toCss(haloColor), 2 * halo);
  on.strokeStyle = toCss(haloColor);
  on.lineWidth = 2 * halo;
  for (const text of texts) word(text, "strokeText");
  for (const [[x, y], [xEnd, yEnd], color] of boxes) {
    on.fillStyle = toCss(color);
    on.fillRect(x, y, xEnd - x, yEnd - y);
  }
  for (const stroke of strokes) line(stroke, toCss(stroke[2]), 0);
  for (const text of texts) {
    on.strokeStyle = toCss(text[4]);
    word(text, "fillText");
  }
  const { data } = on.getImageData(0, 0, width, height);
  return { data, left: begin[0], top: begin[1], width, height };
}

/** Lays groups over a picture.
 * @param {Uint8ClampedArray} pixels RGBA, which change
 * @param {number} columns of the picture */
function annotate(pixels, columns, groups) {
  for (const group of groups) {
    const { data, left, top, width, height } = drawnGroup(group);
    for (let i = 0; i < width * height; ++i) {
      const over = data[4 * i + 3] / 255;
      if (over === 0) continue;
      const at = 4 * ((top + Math.floor(i / width)) * columns + left + i % width);
      const below = (1 - over) * pixels[at + 3] / 255;
      for (let k = 0; k < 3; ++k) {
        pixels[at + k] = (over * data[4 * i + k] + below * pixels[at + k]) / (over + below);
      }
      pixels[at + 3] = 255 * (over + below);
    }
  }
}
