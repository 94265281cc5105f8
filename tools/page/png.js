// png.js -- writes pictures as PNG files. A part of an ES module (make_page.py).

const CAMERA_KEY = "isowave cameras\0"; // as the library has it: core/io/png.cpp
const PNG_SIGNATURE = [137, 80, 78, 71, 13, 10, 26, 10];
const PNG_UP = 2; // the filter: each byte without the one above it

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, i) => {
  let c = i;
  for (let k = 0; k < 8; ++k) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c;
});

function crcOf(bytes) {
  let c = 0xffffffff;
  for (const byte of bytes) c = CRC_TABLE[(c ^ byte) & 255] ^ (c >>> 8);
  return (c ^ 0xffffffff) >>> 0;
}

/** A part of the file: its length, its name, its bytes, their sum. */
function pngPart(name, data) {
  const part = new Uint8Array(data.length + 12);
  const view = new DataView(part.buffer);
  view.setUint32(0, data.length);
  part.set(new TextEncoder().encode(name), 4);
  part.set(data, 8);
  view.setUint32(data.length + 8, crcOf(part.subarray(4, data.length + 8)));
  return part;
}

/**
 * @param {Uint8ClampedArray} pixels RGBA
 * @param {[number, number]} size
 * @param {boolean} isClear whether the file has alpha
 * @param {string} camera a camera file's text, by which pictures are compared
 * @returns {Promise<Blob>}
 */
async function toPng(pixels, [width, height], isClear, camera) {
  const channels = isClear ? 4 : 3;
  const row = 1 + channels * width;
  const rows = new Uint8Array(row * height);
  for (let y = 0; y < height; ++y) {
    rows[row * y] = PNG_UP;
    for (let x = 0; x < width; ++x) {
      for (let k = 0; k < channels; ++k) {
        const at = 4 * (width * y + x) + k;
        rows[row * y + 1 + channels * x + k] = pixels[at] - (y ? pixels[at - 4 * width] : 0);
      }
    }
  }
  const packed = await new Response(
    new Blob([rows]).stream().pipeThrough(new CompressionStream("deflate"))).arrayBuffer();
  const head = new Uint8Array([0, 0, 0, 0, 0, 0, 0, 0, 8, isClear ? 6 : 2, 0, 0, 0]);
  new DataView(head.buffer).setUint32(0, width);
  new DataView(head.buffer).setUint32(4, height);
  return new Blob([new Uint8Array(PNG_SIGNATURE), pngPart("IHDR", head),
    pngPart("IDAT", new Uint8Array(packed)),
    pngPart("tEXt", new TextEncoder().encode(CAMERA_KEY + camera)),
    pngPart("IEND", new Uint8Array())]);
}
