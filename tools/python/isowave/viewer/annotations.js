// annotations.js -- scale bar, axes, colour bar and caption, which the server draws over pictures:
// what wishes, URLs and scene files say of them, and their elements in the panel. A part of an ES
// module (front_end.py).

/** @typedef {{what: string[], units: string, title: string}} Annotations as in wishes; title:
 *    "": the volume's name */

const NO_ANNOTATIONS = { what: [], units: "", title: "" };
const ANNOTATIONS = { // names as the library has them, what they are called and what they are
  "scale-bar": ["Scale bar", "A length at the depth of the point that the camera looks at"],
  axes: ["Axes", "Directions of x, y and z"],
  "color-bar": ["Colour bar", "Values of a colour map's colours, and of slices"],
  caption: ["Caption", "Title, isovalues and their colours"],
};
const MOST_LETTERS = { units: 16, title: 80 }; // as the server has it
const textField = (name, more) =>
  `<input name="${name}" type="text" maxlength="${MOST_LETTERS[name]}" ${more}>`;
/** HTML of the choice of annotations. */
const ANNOTATION_ROWS = `${Object.entries(ANNOTATIONS).map(([name, [text, title]]) => `
    <label title="${title}">${text} <input name="${name}" type="checkbox"></label>`).join("")}
    <label title="Units of the world, for the scale bar and colours along an axis">Units ${
  textField("units", 'placeholder="none"')}</label>
    <label title="First line of the caption">Title ${textField("title", "")}</label>`;

/** @returns {boolean} whether a picture has colours that a bar explains */
const hasBar = (state) => {
  const { color_map: map } = lookOf(state, null);
  return (map !== null && map.by !== "labels") || wishedSurfaces(state).slices.length > 0;
};

/** What a wish says of annotations. */
export function wishedAnnotations(state) {
  const { what, ...texts } = state.annotations;
  const drawn = what.filter((name) => name !== "color-bar" || hasBar(state));
  return { annotations: drawn.length ? { what: drawn, ...texts } : null };
}

/** Parts of a URL's hash. */
function writeAnnotations({ annotations: { what, units, title } }) {
  return {
    ...(what.length && { annotate: what.join(",") }),
    ...(units && { units: encodeURIComponent(units) }),
    ...(title && { title: encodeURIComponent(title) }),
  };
}

/** What writeAnnotations() wrote: parts of a State, without what is not understood. */
function readAnnotations(parts) {
  const what = parts.get("annotate")?.split(",") ?? [];
  const [units, title] = ["units", "title"].map((key) => parts.get(key) ?? "");
  const isGood = what.every((name) => Object.hasOwn(ANNOTATIONS, name))
    && units.length <= MOST_LETTERS.units && title.length <= MOST_LETTERS.title;
  return isGood && (what.length || units || title) ? { annotations: { what, units, title } } : {};
}

const annotationKey = (name) => name.replace("-", "_"); // a name in scene files

/** What a wish says of annotations, as a scene file has it. */
const sceneAnnotations = ({ what, units, title }) => ({
  ...Object.fromEntries(what.map((name) => [annotationKey(name), true])),
  ...(units && { units }), ...(title && { title }) });

/** Fields of a scene file. */
function writeSceneAnnotations(state) {
  const { annotations } = wishedAnnotations(state);
  return annotations ? { annotations: sceneAnnotations(annotations) } : {};
}

/**
 * Parts of a State.
 * @param {Record<string, any>} fields as readScene() has them
 * @throws {Error} that says what this page cannot show
 */
function readSceneAnnotations({ annotations }) {
  if (!annotations) return { annotations: NO_ANNOTATIONS };
  const { units = "", title = "" } = annotations;
  for (const [name, most] of Object.entries(MOST_LETTERS)) {
    if (annotations[name]?.length > most) {
      throw new Error(`annotations.${name}: this page shows up to ${most} letters.`);
    }
  }
  const what = Object.keys(ANNOTATIONS).filter((name) => annotations[annotationKey(name)]);
  return { annotations: { what, units, title } };
}

/** The elements for annotations. */
class AnnotationRows {
  /** @param {View} view whose state it shows and changes */
  constructor(view) {
    this.view = view;
  }

  listen(on) {
    const { view } = this;
    const change = (changes) =>
      view.change({ annotations: { ...view.state.annotations, ...changes } });
    for (const name of Object.keys(ANNOTATIONS)) {
      on(view.field(name), "change", () => change({
        what: Object.keys(ANNOTATIONS).filter((each) => view.field(each).checked) }));
    }
    for (const name of Object.keys(MOST_LETTERS)) {
      on(view.field(name), "input", ({ target: { value } }) => change({ [name]: value }));
    }
  }

  welcome({ title }) {
    this.view.field("title").placeholder = title;
  }

  show(state) {
    const { view } = this;
    const { annotations: { what, units, title } } = state;
    for (const name of Object.keys(ANNOTATIONS)) view.field(name).checked = what.includes(name);
    view.field("color-bar").disabled = !hasBar(state);
    view.set("units", units);
    view.set("title", title);
  }
}
