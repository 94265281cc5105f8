"""Surfaces coloured by the distance along an axis."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import FUEL

import isowave

SIZE = (64, 48)


@pytest.fixture(scope="module")
def scene(volume):
    return volume.renderer(size=SIZE, surfaces=2)


def test_maps_and_axes_colour_the_surface(scene):
    plain = scene.render(6).rgb
    pictures = [
        scene.render(6, color_map=color_map).rgb
        for color_map in (
            "viridis",
            "magma",
            isowave.ColorMap(axis="x"),
            isowave.ColorMap(axis=(1, 1, 0)),
            isowave.ColorMap(range=(0, 10)),
        )
    ]
    for i, picture in enumerate(pictures):
        assert not np.array_equal(picture, plain)
        for other in pictures[:i]:
            assert not np.array_equal(picture, other)


def test_a_table_of_ones_own(scene):
    red = np.zeros((256, 3))
    red[:, 0] = 1
    own = scene.render(6, color_map=isowave.ColorMap(red)).rgb
    assert np.array_equal(own, scene.render(6, color="#ff0000").rgb)


def test_colours_are_those_of_the_places(volume, scene):
    (_, low, _), (_, high, _) = volume.box
    up = scene.render(6, color_map=isowave.ColorMap("gray", axis=(0, 1, 0)))
    down = scene.render(6, color_map=isowave.ColorMap("gray", "y", (high, low)))
    place = (up.position[..., 1] - low) / (high - low)
    # Light is the same in both pictures.
    brighter = up.rgb[..., 0].astype(int) - down.rgb[..., 0]
    above, below = place > 0.52, place < 0.48
    assert above.sum() > 10 and below.sum() > 10
    assert (brighter[above] > 0).all() and (brighter[below] < 0).all()


def test_several_surfaces_and_the_host(volume, scene):
    surfaces = [isowave.Surface(6, opacity=0.5), isowave.Surface(60)]
    image = scene.render(surfaces=surfaces, color_map="cividis")
    host = volume.render(surfaces=surfaces, size=SIZE, color_map="cividis", device="host")
    assert np.array_equal(image.rgb, host.rgb)
    assert not np.array_equal(image.rgb, scene.render(surfaces=surfaces).rgb)


def test_files_have_the_programs_bits(program, tmp_path):
    color_map = isowave.ColorMap("coolwarm", "x", (2, 30))
    image = isowave.open(FUEL, exact=True).render(10, size=(96, 72), color_map=color_map)
    image.save(tmp_path / "a.png")
    program("render", FUEL, "-i", 10, "--exact", "--size", "96x72", "--color-by", "x,2,30",
            "--color-map", "coolwarm", "-o", tmp_path / "b.png")  # fmt: skip
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"color_map": "jet"}, "there is no colour map 'jet'"),
        ({"color_map": 3}, "color_map"),
        ({"color_map": isowave.ColorMap(np.zeros((3, 3)))}, "shape"),
        ({"color_map": isowave.ColorMap(np.full((256, 3), 2.0))}, "out of range"),
        ({"color_map": isowave.ColorMap(axis="w")}, "axis"),
        ({"color_map": isowave.ColorMap(axis=(0, 0, 0))}, "direction"),
        ({"color_map": isowave.ColorMap(range=(1, 1))}, "two numbers that differ"),
        ({"color_map": "gray", "color": "bone"}, "the colour map colours surfaces"),
    ],
)
def test_what_cannot_be_shown_is_refused(scene, arguments, message):
    with pytest.raises((ValueError, TypeError, isowave.Error), match=message):
        scene.render(6, **arguments)


def field_of(volume):
    """Its values are x, on another grid."""
    (x0, y0, z0), (x1, y1, z1) = volume.box
    x = np.linspace(x0, x1, 20, dtype=np.float32)
    return isowave.compress(
        np.broadcast_to(x, (9, 11, 20)),
        spacing=((z1 - z0) / 8, (y1 - y0) / 10, (x1 - x0) / 19),
        origin=(z0, y0, x0),
        rate=24,
    )


def test_a_field_colours_the_surface(volume):
    by_field = isowave.ColorMap("gray", by="field")
    pictures = []
    for device in ("cpu", "host"):
        renderer = volume.renderer(size=SIZE, field=field_of(volume), device=device)
        image = renderer.render(6, color_map=by_field, outputs=("rgb", "position", "field"))
        hit = ~np.isnan(image.position[..., 0])
        assert np.allclose(image.field[hit], image.position[hit][:, 0], atol=1e-2)
        assert np.isnan(image.field[~hit]).all()
        low, high = image.statistics["field_range"]
        assert low == image.field[hit].min() and high == image.field[hit].max()
        pictures.append(image.rgb)
    assert np.array_equal(*pictures)


def test_volumes_are_drawn_by_a_field_at_once(volume):
    field, by_field = field_of(volume), isowave.ColorMap("gray", by="field")
    renderer = volume.renderer(size=SIZE, field=field)
    expected = renderer.render(6, color_map=by_field).rgb
    for device in ("cpu", "host", None):
        for _ in range(2):
            image = volume.render(6, size=SIZE, device=device, field=field, color_map=by_field)
            assert np.array_equal(image.rgb, expected)
    kept = volume._renderer
    assert volume.render(6, size=SIZE).field is None and volume._renderer is kept
    with pytest.raises(isowave.Error, match="field=VOLUME"):
        isowave.compress(np.zeros((4, 4, 4), np.float32)).render(0, color_map=by_field)


def test_a_field_colours_several_surfaces(volume):
    field = field_of(volume)
    (low, *_), (high, *_) = volume.box  # the field's values
    by_field = isowave.ColorMap("gray", by="field")
    skin, bone = isowave.Surface(8, "skin", 0.4), isowave.Surface(4, "bone")
    own = [replace(each, mapped=False) for each in (skin, bone)]

    def draw(surfaces, **more):
        image = volume.render(surfaces=surfaces, size=SIZE, field=field, **more)
        return image.rgb.tobytes(), image

    pictures = set()
    for surfaces in ([skin, bone], [own[0], bone], own):
        drawn = [draw(surfaces, device=name, color_map=by_field) for name in ("cpu", "host")]
        assert drawn[0][0] == drawn[1][0]
        assert drawn[0][1].statistics["color_range"] == pytest.approx((low, high))
        pictures.add(drawn[0][0])
    assert len(pictures) == 3
    assert drawn[0][0] == draw(own)[0]
    for device in ("cpu", "host"):
        seen: list[bytes] = []  # after each pass
        keep = lambda progress: seen.append(progress.rgb.tobytes())  # noqa: E731
        whole, _ = draw([skin, bone], device=device, color_map=by_field, on_pass=keep)
        assert seen[-1] == whole
    given = replace(by_field, range=(low, high))
    assert draw([skin, bone], color_map=given)[0] in pictures
    wider = replace(given, range=(low, high + 9))
    assert draw([skin, bone], color_map=wider)[0] not in pictures
    with pytest.raises(isowave.Error, match="values of a field are those of one opaque surface"):
        draw(own, color_map=by_field, outputs=("rgb", "field"))
    scene = volume.scene().surface(8, "skin", 0.4, mapped=False).surface(4, "bone")
    image = scene.look(field=field, color_map=by_field).render(size=SIZE)
    assert image.rgb.tobytes() == draw([own[0], bone], color_map=by_field)[0]


def test_caps_show_the_voxels(volume):
    (x0, y0, z0), (x1, y1, z1) = volume.box
    cut = [isowave.ClipPlane((0, 0, -1), -(z0 + z1) / 2)]
    shown = isowave.ColorMap("gray", by="caps")
    arguments = {"size": SIZE, "clip": cut, "color": "red", "outputs": ("rgb", "cap", "field")}
    plain = volume.render(6, size=SIZE, clip=cut, color="red", outputs=("rgb", "cap"))
    for device in ("cpu", "host"):
        image = volume.render(6, color_map=shown, device=device, **arguments)
        assert image.cap.any() and not image.cap.all()
        assert np.array_equal(~np.isnan(image.field), image.cap)
        assert np.array_equal(image.rgb[~image.cap], plain.rgb[~image.cap]), "their own colour"
        assert not np.array_equal(image.rgb[image.cap], plain.rgb[image.cap])
        values = image.field[image.cap]
        assert image.statistics["field_range"] == (values.min(), values.max())
        assert values.max() > values.min()


def test_fields_are_refused_in_one_line(volume):
    renderer = volume.renderer(size=SIZE)
    by_field = isowave.ColorMap(by="field")
    for arguments in ({"color_map": by_field}, {"outputs": ("field",)}):
        with pytest.raises(isowave.Error, match="field=VOLUME"):
            renderer.render(6, **arguments)
    with pytest.raises(TypeError, match="field"):
        volume.renderer(size=SIZE, field="other")
    with pytest.raises(ValueError, match="axis, depth, field, caps, labels"):
        renderer.render(6, color_map=isowave.ColorMap(by="time"))
