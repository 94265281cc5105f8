// relaxed.js -- fits the engine's module to a browser. It has relaxed vector instructions, among
// them a multiply-add that may be rounded once or twice, as the browser likes. Isosurfaces are
// exact if it is rounded once. In other browsers, a call of a function takes its place: the module
// says where (relaxed.py).

const RELAXED_SECTION = "isowave.relaxed";
const CALL = 0x10;
const VECTOR = 0xfd;
const RELAXED_TRUNC = [0x81, 0x02]; // i32x4.relaxed_trunc_f32x4_s, of one operand
const TRUNC = [0xf8, 0x01]; // i32x4.trunc_sat_f32x4_s
/** A module of a function f(a, c) = a * a + c by f32x4.relaxed_madd. */
const MADD = [0, 0x61, 0x73, 0x6d, 1, 0, 0, 0, // "asm", version 1
  1, 7, 1, 0x60, 2, 0x7d, 0x7d, 1, 0x7d, // of two float32 a float32
  3, 2, 1, 0, // a function
  7, 5, 1, 1, 0x66, 0, 0, // "f"
  10, 22, 1, 20, 0, // its code: no variables
  0x20, 0, VECTOR, 0x13, 0x20, 0, VECTOR, 0x13, 0x20, 1, VECTOR, 0x13, // a, a, c in all lanes
  VECTOR, 0x85, 2, VECTOR, 0x1f, 0, 0x0b]; // the first lane

/** Whether this browser has relaxed vectors, and rounds their multiply-add once. */
async function fusesMultiplyAdd() {
  const bytes = new Uint8Array(MADD);
  if (!WebAssembly.validate(bytes)) return false;
  const { instance } = await WebAssembly.instantiate(bytes);
  return instance.exports.f(1 + 2 ** -23, -(1 + 2 ** -22)) === 2 ** -46;
}

/** An unsigned LEB128 number, and the place behind it. */
function lebAt(bytes, at) {
  let number = 0;
  for (let shift = 0; ; shift += 7, ++at) {
    number += (bytes[at] & 0x7f) * 2 ** shift;
    if (bytes[at] < 0x80) return [number, at + 1];
  }
}

/** Where the content of the section begins: behind its name. It is the module's last one. */
function relaxedSection(bytes) {
  for (let begin = 8; begin < bytes.length;) {
    const [size, content] = lebAt(bytes, begin + 1);
    const end = content + size;
    if (end === bytes.length && bytes[begin] === 0) return content + 1 + RELAXED_SECTION.length;
    begin = end;
  }
  throw new Error("it is damaged");
}

/** Puts other instructions in the place of relaxed ones. */
function withoutRelaxed(bytes) {
  let at = relaxedSection(bytes);
  const call = [CALL, bytes[at], bytes[at + 1]];
  at += 2;
  for (let place = 0; at < bytes.length;) {
    const [distance, next] = lebAt(bytes, at);
    place += distance;
    at = next;
    const isTrunc = RELAXED_TRUNC.every((byte, i) => bytes[place + 1 + i] === byte);
    bytes.set(isTrunc ? [VECTOR, ...TRUNC] : call, place);
  }
  return bytes;
}

/**
 * @param {ArrayBuffer} file the engine's module
 * @returns {Promise<Uint8Array>} it, for this browser
 */
async function fitted(file) {
  const bytes = new Uint8Array(file);
  return await fusesMultiplyAdd() ? bytes : withoutRelaxed(bytes);
}
