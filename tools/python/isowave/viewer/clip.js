// clip.js -- clipping: sliders for the part of the volume that is drawn. A part of an ES module
// (front_end.py).

const WHOLE = [0, 100, 0, 100, 0, 100]; // clip of a State that leaves out nothing
const LEAST_CLIP = 1; // between both ends of an axis [%]
/** HTML of the sliders: a row with two for each axis of the world. */
const CLIP_ROWS = ["x", "y", "z"].map((axis) => `
    <div class="clip"><span aria-hidden="true">${axis}</span><div>${
  ["from", "to"].map((end) => `<input type="range" min="0" max="100" step="0.5"
      name="clip_${axis}_${end}" aria-label="${axis} ${end}">`).join("")}</div></div>`).join("");

/** A changed end of the range along an axis: the other end stays, a little apart. */
export function moveClip(clip, i, percent) {
  const moved = [...clip];
  moved[i] = i % 2 ? Math.max(percent, clip[i - 1] + LEAST_CLIP)
    : Math.min(percent, clip[i + 1] - LEAST_CLIP);
  return moved;
}

/**
 * The clipping planes of a wish.
 * @param {number[]} clip as in State
 * @param {[Vec, Vec]} box corners of the volume's box in world space
 */
export function clipPlanes(clip, [begin, end]) {
  return clip.flatMap((percent, i) => {
    if (percent === WHOLE[i]) return [];
    const [axis, sign] = [i >> 1, i % 2 ? -1 : 1];
    const at = begin[axis] + (percent / 100) * (end[axis] - begin[axis]);
    return [{ normal: [0, 1, 2].map((k) => (k === axis ? sign : 0)), offset: sign * at }];
  });
}

/** @returns {boolean} whether it is a State's clip */
function isClip(clip) {
  return clip.length === 6 && [0, 2, 4].every((i) =>
    clip[i] >= 0 && clip[i] + LEAST_CLIP <= clip[i + 1] && clip[i + 1] <= 100);
}
