"""Annotated pictures: they change where the layout says, and as far as the compiled part says."""

import builtins

import numpy as np
import PIL.ImageFont
import pytest
from conftest import FUEL

import isowave
from isowave import _core
from isowave._annotate import annotations_for_core

SIZE = (320, 240)


@pytest.fixture(scope="module")
def volume():
    return isowave.open(FUEL, exact=True)


def draw(volume, **more):
    return volume.render(40, size=SIZE, device="host", **more)


def groups_of(image, what="all", **more):
    has_bar = bool(image._fields.get("color_map") or image._fields.get("slices"))
    wanted = annotations_for_core(isowave.Annotations(what, **more), has_bar)
    ranges = (image.statistics["color_range"], image.statistics["slice_range"])
    return _core.annotation_layout(wanted, image._fields, *ranges)


@pytest.mark.parametrize(
    "look",
    [
        {},
        {"color_map": isowave.ColorMap("magma", "y"), "background": "black"},
        {"transparent": True, "samples": 2},
    ],
)
def test_pictures_change_in_the_groups_alone(volume, look):
    image = draw(volume, **look)
    plain = image.rgba if look.get("transparent") else image.rgb
    before = plain.copy()
    annotated = image.annotated(units="mm", title="fuel.raw")
    assert np.array_equal(plain, before) and annotated is not plain
    assert annotated.shape == plain.shape and annotated.dtype == np.uint8
    changed = (annotated != plain).any(axis=2)
    groups = groups_of(image, units="mm", title="fuel.raw")
    assert len(groups) == (4 if "color_map" in look else 3)
    for group in groups:
        (left, top), (right, bottom) = group["begin"], group["end"]
        assert changed[top:bottom, left:right].sum() > 100
        changed[top:bottom, left:right] = False
    assert not changed.any()
    # The middle of the scale bar: its colour, and opaque.
    points, _, color = groups[0]["strokes"][0]
    x, y = int((points[1][0] + points[2][0]) / 2), int(points[1][1] - 0.5)
    assert np.abs(annotated[y, x, :3] - 255.0 * np.array(color)).max() < 130
    assert annotated.shape[2] == 3 or annotated[y, x, 3] == 255


def test_the_scale_bar_is_as_long_as_it_says(volume):
    camera = isowave.Camera((100, 20, 90), (30, 16, 16), parallel_height=60.0)
    image = draw(volume, camera=camera)
    (group,) = groups_of(image, "scale-bar", units="mm")
    points = group["strokes"][0][0]
    assert group["texts"][0][3] == "20 mm"
    assert (points[2][0] - points[1][0]) * 60 / 240 == pytest.approx(20)


def test_slices_have_a_bar_of_their_own(volume):
    """At the place of the only bar, or below that of the surfaces."""
    z = isowave.Slice("z", 16)
    alone = draw(volume, slices=[z], slice_map=isowave.ColorMap("magma", range=(10, 90)))
    assert alone.statistics["slice_range"] == (10, 90)
    assert draw(volume).statistics["slice_range"] is None
    (bar,) = groups_of(alone, "color-bar")
    assert "slices" in {text[3] for text in bar["texts"]}
    image = draw(volume, slices=[z], color_map="gray")
    upper, lower = groups_of(image, "color-bar")
    assert upper["end"][1] <= lower["begin"][1]
    assert "z" in {text[3] for text in upper["texts"]}
    assert "slices" in {text[3] for text in lower["texts"]}
    assert len(groups_of(image)) == 5


def test_color_ranges_are_those_of_the_picture(volume):
    image = draw(volume, color_map=isowave.ColorMap("gray", "x", (2, 9)))
    assert image.statistics["color_range"] == (2, 9)
    assert draw(volume, color_map="gray").statistics["color_range"] == (0, 31)
    assert draw(volume).statistics["color_range"] is None
    renderer = volume.renderer(size=SIZE, device="host", field=volume)
    by_field = renderer.render(40, color_map=isowave.ColorMap(by="field"))
    assert by_field.statistics["color_range"] == by_field.statistics["field_range"]
    assert len(groups_of(by_field, "color-bar")) == 1


def test_names_choose_what_is_drawn(volume):
    image = draw(volume)
    parts = [image.annotated(name) != image.rgb for name in ("scale-bar", "axes", "caption")]
    assert all(part.any() for part in parts)
    whole = image.annotated(["axes", "caption", "scale-bar"])
    assert np.array_equal(whole != image.rgb, parts[0] | parts[1] | parts[2])
    assert np.array_equal(image.annotated(), whole)
    assert np.array_equal(image.annotated(()), image.rgb)


def test_scenes_say_what_is_drawn_over_their_pictures(volume):
    scene = volume.scene().surface(40).annotate(["axes", "caption"], units="mm", title="fuel")
    image = scene.render(size=SIZE, device="host")
    assert image.annotations == scene.annotations
    assert image.annotations == isowave.Annotations(("axes", "caption"), "mm", "fuel")
    plain = draw(volume)
    assert np.array_equal(image.rgb, plain.rgb), "without annotations"
    own = plain.annotated(["axes", "caption"], units="mm", title="fuel")
    assert np.array_equal(image.annotated(), own)
    # Arguments come in the place of the scene's.
    assert np.array_equal(image.annotated("caption"), plain.annotated("caption", title="fuel"))
    bar = plain.annotated("scale-bar", units="km")
    assert np.array_equal(image.annotated("scale-bar", units="km"), bar)
    assert np.array_equal(image.annotated(title=""), plain.annotated(["axes", "caption"]))
    assert np.array_equal(image.annotated(()), plain.rgb)
    none = scene.annotate(()).render(size=SIZE, device="host")
    assert none.annotations is None and np.array_equal(none.annotated(), plain.annotated())


def test_letters_that_pillow_lacks_are_those_of_a_font_of_the_system(volume):
    try:
        PIL.ImageFont.truetype("DejaVuSans.ttf", 10)
    except OSError:
        pytest.skip("no DejaVu fonts are installed")
    image = draw(volume)
    micro, angstrom = (image.annotated("scale-bar", units=units) for units in ("µm", "Åm"))
    assert not np.array_equal(micro, angstrom), "both were the sign of a missing letter"


def test_what_cannot_be_is_one_line(volume, monkeypatch):
    image = draw(volume)
    with pytest.raises(ValueError, match="what axis: there are scale-bar, axes, color-bar, capt"):
        image.annotated("axis")
    with pytest.raises(TypeError, match="units=3: give a text"):
        image.annotated(units=3)
    for give in (volume.scene().annotate, isowave.Annotations):
        with pytest.raises(ValueError, match="what axis: there are scale-bar, axes, color-bar"):
            give("axis")
        with pytest.raises(TypeError, match="title=3: give a text"):
            give(title=3)
        with pytest.raises(TypeError, match="what=3: give a sequence of names"):
            give(3)
    with pytest.raises(isowave.Error, match="a colour bar needs a colour map"):
        image.annotated("color-bar")
    small = volume.render(40, size=(64, 48), device="host")
    with pytest.raises(isowave.Error, match="64 x 48 pixels are too few for annotations"):
        small.annotated()
    with pytest.raises(ValueError, match="was not asked for"):
        draw(volume, outputs=("depth",)).annotated()
    imported = builtins.__import__

    def without_pillow(name, *more):
        if name.startswith("PIL"):
            raise ImportError(name)
        return imported(name, *more)

    monkeypatch.setattr(builtins, "__import__", without_pillow)
    with pytest.raises(isowave.Error, match="annotations need Pillow: pip install"):
        image.annotated()
