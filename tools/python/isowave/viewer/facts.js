// facts.js -- what the panel says of a picture. A part of an ES module (front_end.py).

/**
 * @param {Message} head of a finished picture
 * @param {State} state that it shows
 * @returns {Record<string, string>} names and values
 */
function factsOf(head, state) {
  const share = state.by === "sample" ? "99 % of the hits" : "most pixels";
  const { max_error: error } = wishedSurfaces(state);
  const detail = error ? `${share} within ${toText(error)} px` : "at full detail";
  const certain = !head.complete ? "the time was over: not complete"
    : head.detail?.reachable === false ? head.detail.advice || "that error is out of reach"
      : `complete, ${detail}`;
  const rays = head.samples > 1 ? `, ${head.samples ** 2} rays a pixel` : "";
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
