// facts.js -- what the panel says of a picture. A part of an ES module (front_end.py).

/**
 * @param {Message} head of a finished picture
 * @param {State} state that it shows
 * @returns {Record<string, string>} names and values
 */
function factsOf(head, state) {
  const certain = !head.complete ? "the time was over: not complete"
    : head.detail?.reachable === false ? outOfReach(head.detail, state)
      : `complete, ${errorOf(head.detail, state)}`;
  const count = head.samples ** 2;
  const rays = count > 1 ? `, ${count} rays a pixel` : choosesRays(state) ? ", 1 ray a pixel" : "";
  return {
    Size: `${head.size[0]} × ${head.size[1]}${rays}`,
    Passes: toCount(head.passes),
    "Blocks decoded": toCount(head.decoded_blocks),
    Time: `${toShort(head.ms)} ms`,
    ...(head.rays_cut && { "Rays cut": `${toCount(head.rays_cut)}, after 16 hits` }),
    ...(head.field_range && { "Field at the hits": head.field_range.map(toText).join(" to ") }),
    Picture: certain,
  };
}

/** The error of a picture that keeps it, in words. detail: as in head; null: full detail. */
function errorOf(detail, state) {
  const { max_error: error, by, voxel_pixels: voxels } = wishedQuality(state);
  if (voxels) return `voxels up to ${toText(voxels)} px apart`;
  if (by !== "picture") {
    const share = by === "sample" ? "99 % of the hits" : "most pixels";
    return error ? `${share} within ${toText(error)} px` : "at full detail";
  }
  if (!detail) return "at full detail";
  const { flip, highest_flip: highest } = detail;
  const most = highest > flip ? `, at most ${toShort(highest)} with 95 % confidence` : "";
  return `FLIP ${toShort(flip)}${most}`;
}

/** Why a picture does not keep its error. */
function outOfReach({ advice }, { by, max_error: error }) {
  if (by === "picture") return `FLIP ${toText(error)} is out of reach: ${advice}`;
  return advice || "that error is out of reach";
}

/** The elements for the share of the surface that is certain. */
function boundsElements(head) {
  const percent = Math.floor(1000 * head.within_pixel) / 10;
  const [name, value] = [document.createElement("dt"), document.createElement("dd")];
  name.textContent = head.errors_are_stated ? "By its file" : "Certain";
  value.textContent = `${percent} % within 1 px`;
  value.title = "of the surface: no further from that of the volume before compression"
      + (head.errors_are_stated ? ", if the errors are right that the file states" : "");
  return [name, value];
}
