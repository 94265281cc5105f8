// page_engine.cjs ENGINE.js WORKER.js VOLUME SCENE.json EXPECTED.png [FIELD.zfp] [plain]: runs a
// page's worker under node, as the page does; `plain`: as in a browser without relaxed vectors. The
// picture of 96 x 54 pixels and two ambient rays must be the expected one, and so must bands of
// rows, which other workers draw. FIELD is a second volume. What the engine refuses is an error of
// one line.
const assert = require("node:assert");
const fs = require("node:fs");
const zlib = require("node:zlib");

const [glue, code, volume, sceneFile, expectedFile, ...more] = process.argv.slice(2);
const plain = more.at(-1) === "plain";
const field = more[0]?.endsWith(".zfp") ? fs.readFileSync(more[0]) : null;
globalThis.self = { location: { href: "" } }; // as in a worker
globalThis.createEngine = require(fs.realpathSync(glue));
const binary = fs.readFileSync(glue.replace(/js$/, "wasm"));

const SIZE = [96, 54];
const answers = new Map();
globalThis.postMessage = ({ id, ...answer }) => answers.get(id)(answer);
for (const script of [code.replace("worker.js", "relaxed.js"), code])
  (0, eval)(fs.readFileSync(script, "utf8")); // as scripts of page and worker

let asked = 0;
const ask = (request) => new Promise((answer) => {
  answers.set(++asked, answer);
  globalThis.onmessage({ data: { id: asked, ...request } });
});

/** Pixels of a PNG of 8-bit RGB whose rows have filters: those that libpng chose. */
function pixelsOf(png, [width, height]) {
  const parts = [];
  for (let at = 8; at < png.length;) {
    const size = png.readUInt32BE(at);
    const isPixels = png.toString("latin1", at + 4, at + 8) === "IDAT";
    if (isPixels) parts.push(png.subarray(at + 8, at + 8 + size));
    at += 12 + size;
  }
  const raw = zlib.inflateSync(Buffer.concat(parts));
  const row = 3 * width;
  const pixels = new Uint8Array(row * height);
  for (let y = 0; y < height; ++y) {
    const filter = raw[y * (row + 1)];
    for (let x = 0; x < row; ++x) {
      const left = x < 3 ? 0 : pixels[y * row + x - 3];
      const up = y ? pixels[(y - 1) * row + x] : 0;
      const corner = x < 3 || !y ? 0 : pixels[(y - 1) * row + x - 3];
      const [a, b, c] = [up - corner, left - corner, left + up - 2 * corner].map(Math.abs);
      const paeth = a <= b && a <= c ? left : b <= c ? up : corner;
      const add = [0, left, up, (left + up) >> 1, paeth][filter];
      pixels[y * row + x] = raw[y * (row + 1) + 1 + x] + add;
    }
  }
  return pixels;
}

async function main() {
  if (plain) WebAssembly.validate = () => false;
  const fit = await fitted(Uint8Array.from(binary).buffer);
  assert.equal(binary.equals(fit), !plain, "relaxed vectors");
  const module = await WebAssembly.compile(fit);
  assert.deepEqual(Object.keys(await ask({ what: "start", module })), ["took"]);
  const isError = ({ error }) => assert.match(error, /^[^\n]+$/);
  const scene = JSON.parse(fs.readFileSync(sceneFile, "utf8"));
  isError(await ask({ what: "draw", scene, size: SIZE })); // no volume
  isError(await ask({ what: "open", name: "a.zfp", bytes: new Uint8Array(99) }));
  isError(await ask({ what: "open", name: "a.xyz", bytes: new Uint8Array(99) }));

  const name = volume.replace(/.*\//, "");
  const { data: zfp, ...facts } = await ask({ what: "open", name, bytes: fs.readFileSync(volume),
    keep: true });
  assert.deepEqual(facts.shape, [32, 33, 64]);
  assert.equal(facts.dtype, "uint8");
  const damaged = zfp.slice(0, zfp.length - 9);
  isError(await ask({ what: "open", name: "a.zfp", bytes: damaged }));
  const { error, second } = await ask({ what: "open", name: "a.zfp", bytes: zfp, field });
  assert.ok(!error, error);
  assert.equal(second?.dtype, field ? "uint8" : undefined);

  const request = { what: "draw", scene, size: SIZE, samples: 1, ambient: 2 };
  const expected = pixelsOf(fs.readFileSync(expectedFile), SIZE);
  let hits = 0;
  for (const rows of [[0, 54], [0, 1], [1, 30], [30, 54]]) {
    const { data, hits: count } = await ask({ ...request, rows });
    hits += count;
    const rgb = data.filter((_, i) => i % 4 !== 3);
    assert.ok(data.every((value, i) => i % 4 !== 3 || value === 255));
    assert.deepEqual(rgb, expected.slice(3 * SIZE[0] * rows[0], 3 * SIZE[0] * rows[1]), `${rows}`);
  }
  assert.ok(hits > 200);
  isError(await ask({ ...request, rows: [54, 60] }));
  isError(await ask({ ...request, scene: { ...scene, surfaces: [] } }));

  const { position, value } = await ask({ ...request, what: "probe", at: [0.5, 0.5] });
  assert.equal(position.length, 3);
  assert.ok(Math.abs(value - scene.surfaces[0].isovalue) < 0.01, `${value}`);
  assert.equal((await ask({ ...request, what: "probe", at: [0, 0] })).position, null);
  const histogram = await ask({ what: "histogram", bins: 256 });
  assert.equal(histogram.counts.reduce((a, b) => a + b), 64 * 33 * 32);
  assert.ok(histogram.suggested.length > 0);
}

main().catch((error) => {
  console.error(error);
  process.exit(1);
});
