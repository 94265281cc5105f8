"""Scenes and their files: what Python, C++ and the program write, each of them reads."""

from __future__ import annotations

import dataclasses
import json
import pathlib
import pickle
from typing import Any

import numpy as np
import pytest

import isowave
from isowave._source_file import source_file

SIZE = (48, 36)
CAMERA = isowave.Camera((40, 30, 60), (8, 8, 8))
HALF = isowave.ClipPlane((0, 0, -1), -9)


@pytest.fixture(scope="module")
def ball() -> isowave.Volume:
    z, y, x = np.mgrid[0:17, 0:17, 0:17] - 8.0
    return isowave.compress((8 - np.sqrt(x * x + y * y + z * z)).astype(np.float32), exact=True)


def two(ball: isowave.Volume) -> isowave.Scene:
    scene = ball.scene().surface(1, "#3060c0", opacity=0.5).surface(5, (0.1, 0.2, 0.3))
    return scene.clip(HALF, caps=False).seen_from(CAMERA).annotate("caption", title="two")


def one(ball: isowave.Volume) -> isowave.Scene:
    scene = ball.scene().surface(3, "orange").look(background="black", lights={"above": 0.9})
    scene = scene.look(light=(1, 2, 1), shadow_rays=2, light_angle=5.0, bounce_rays=2)
    scene = scene.look(background_top="skin")
    return scene.seen_from(dataclasses.replace(CAMERA, parallel_height=20.0))


def mapped(ball: isowave.Volume) -> isowave.Scene:
    color_map = isowave.ColorMap("magma", (1, 1, 0), (3.5, 20.0))
    scene = ball.scene().surface(3).look(color_map=color_map, transparent=True)
    return scene.annotate(units="µm")


def by_own_caps(ball: isowave.Volume) -> isowave.Scene:
    color_map = isowave.ColorMap("gray", range=(1.0, 7.5), by="caps")
    return ball.scene().surface(3, "red").clip(HALF).look(color_map=color_map)


def picture(scene: isowave.Scene) -> Any:
    image = scene.render(size=SIZE, device="host")
    return image.rgba if scene.transparent else image.rgb


@pytest.mark.parametrize("make", [two, one, mapped, by_own_caps])
def test_files_keep_what_is_drawn(ball: isowave.Volume, make: Any, tmp_path: pathlib.Path) -> None:
    scene = make(ball)
    scene.save(tmp_path / "scene.json")
    read = isowave.open_scene(tmp_path / "scene.json", volume=ball)
    assert np.array_equal(picture(read), picture(scene))
    assert read.planes == scene.planes and read.caps == scene.caps and read.view == scene.view
    read.save(tmp_path / "again.json")
    text = (tmp_path / "again.json").read_text()
    assert text == (tmp_path / "scene.json").read_text()
    assert json.loads(text)["isowave_scene"] == 1


def test_annotations_are_kept(ball: isowave.Volume, tmp_path: pathlib.Path) -> None:
    file = tmp_path / "scene.json"

    def written(scene: isowave.Scene) -> Any:
        scene.save(file)
        return json.loads(file.read_text()).get("annotations")

    assert written(one(ball)) is None
    assert isowave.open_scene(file, volume=ball).annotations is None
    assert written(two(ball)) == {"caption": True, "title": "two"}
    read = isowave.open_scene(file, volume=ball)
    assert read.annotations == isowave.Annotations(("caption",), "", "two")
    # "all" has a colour bar if there are colours that it explains.
    bars = {"scale_bar": True, "axes": True, "caption": True}
    assert written(one(ball).annotate()) == bars
    assert written(one(ball).slice("z").annotate()) == bars | {"color_bar": True}
    assert written(mapped(ball)) == bars | {"color_bar": True, "units": "µm"}
    image = mapped(ball).render(size=(240, 180), device="host")
    again = isowave.open_scene(file, volume=ball).render(size=(240, 180), device="host")
    assert np.array_equal(again.annotated(), image.annotated())


def test_titles_are_those_of_the_files(ball: isowave.Volume, tmp_path: pathlib.Path) -> None:
    ball.save(tmp_path / "ball.zfp")
    file = tmp_path / "scene.json"

    def title(scene: isowave.Scene, **volume: Any) -> str:
        scene.save(file, volume=tmp_path / "ball.zfp")
        read = isowave.open_scene(file, **volume).annotations
        assert read is not None
        return read.title

    assert title(one(ball).annotate("caption")) == "ball.zfp"
    assert title(one(ball).annotate("caption", title="a ball")) == "a ball"
    assert title(one(ball).annotate("caption"), volume=ball) == "", "it may be of another file"


def test_a_field_of_the_volumes_file_is_the_volume(
    ball: isowave.Volume, tmp_path: pathlib.Path
) -> None:
    ball.save(tmp_path / "ball.zfp")
    ball.save(tmp_path / "copy.zfp")
    file = tmp_path / "scene.json"
    scene = by_own_caps(ball)
    for name, is_shared in (("ball.zfp", True), ("copy.zfp", False)):
        scene.save(file, volume=tmp_path / "ball.zfp")
        fields = json.loads(file.read_text())
        assert fields["field"] == "volume"
        file.write_text(json.dumps({**fields, "field": name}))
        read = isowave.open_scene(file)
        assert (read.field is read.volume) == is_shared
        assert np.array_equal(picture(read), picture(scene))


def test_tables_of_colours_are_kept(ball: isowave.Volume, tmp_path: pathlib.Path) -> None:
    table = np.linspace(0, 1, 256)[:, None] * [1, 0.5, 0.25]
    scene = ball.scene().surface(3).look(color_map=isowave.ColorMap(table))
    scene.save(tmp_path / "scene.json")
    read = isowave.open_scene(tmp_path / "scene.json", volume=ball)
    assert np.array_equal(picture(read), picture(scene))


def test_scenes_open_their_volume(ball: isowave.Volume, tmp_path: pathlib.Path) -> None:
    ball.save(tmp_path / "ball.zfp")
    one(ball).save(tmp_path / "scene.json", volume=tmp_path / "ball.zfp")
    assert json.loads((tmp_path / "scene.json").read_text())["volume"].endswith("ball.zfp")
    read = isowave.open_scene(tmp_path / "scene.json")
    assert np.array_equal(picture(read), picture(one(ball)))


def test_fields_are_opened_with_their_scene(ball: isowave.Volume, tmp_path: pathlib.Path) -> None:
    values = np.broadcast_to(np.arange(12, dtype=np.float32), (12, 12, 12))
    heat = isowave.compress(values, exact=True, origin=(4, 2, 6))
    heat.save(tmp_path / "heat.zfp")
    ball.save(tmp_path / "ball.zfp")
    by_field = isowave.ColorMap("magma", by="field")
    # Hits outside the field have the surface's own colour.
    near = isowave.Camera((16, 14, 24), (8, 8, 8))
    scene = ball.scene().surface(3, "green").seen_from(near).look(color_map=by_field, field=heat)
    file = tmp_path / "scene.json"
    scene.save(file, volume=tmp_path / "ball.zfp", field=tmp_path / "heat.zfp")
    fields = isowave._core.read_scene(str(file))
    assert fields["field"] == str(tmp_path / "heat.zfp") and fields["color_by_field"]
    read = isowave.open_scene(file)
    assert np.array_equal(picture(read), picture(scene))
    green = ball.render(3, size=SIZE, camera=near, color="green", device="host").rgb
    assert not np.array_equal(picture(scene), green)
    assert (picture(scene) == green).all(axis=-1)[(green != 255).any(axis=-1)].any()
    given = isowave.open_scene(file, field=ball)
    assert given.field is ball and not np.array_equal(picture(given), picture(scene))
    # Options are those of the volume; those of its compression are the field's, too.
    raw = tmp_path / "any.raw"
    raw.write_bytes(np.ascontiguousarray(ball[...]).tobytes())
    scene.save(file, volume=raw, field=tmp_path / "heat.zfp")
    options: dict[str, Any] = {"shape": ball.shape, "dtype": "float32", "rate": 32}
    assert isowave.open_scene(file, **options).field.shape == heat.shape
    scene.save(file, volume=raw, field="generate:sphere_8x8x8_uint8")
    assert isowave.open_scene(file, **options).field.bits_per_voxel == 32
    scene.save(file, volume=tmp_path / "ball.zfp")
    with pytest.raises(isowave.Error, match="scene.json: it names no field: give field="):
        isowave.open_scene(file)
    scene.save(file, field=tmp_path / "absent.zfp")
    with pytest.raises(isowave.Error, match="absent.zfp: no such file"):
        isowave.open_scene(file, volume=ball)
    with pytest.raises(TypeError, match="field='heat.zfp': give an isowave.Volume"):
        picture(scene.look(field="heat.zfp"))
    by_own_caps(ball).save(file)
    assert isowave._core.read_scene(str(file))["field"] == "volume"
    assert isowave.open_scene(file, volume=ball).field is ball


def test_one_opaque_surface_is_drawn_with_all_arguments(ball: isowave.Volume) -> None:
    scene = one(ball).clip(HALF, caps=False)  # the inside of a bowl sees less of the sky
    image = scene.render(size=SIZE, device="host", ambient_rays=4)
    assert not np.array_equal(image.rgb, picture(scene))


def test_scenes_are_values(ball: isowave.Volume) -> None:
    scene = two(ball)
    assert scene.look(background="red").background == "red" and scene.background is None
    assert scene.seen_from(None).view is None and scene.view == CAMERA
    assert ball.scene().clip(HALF).caps and not scene.caps


def test_what_is_wrong_is_one_line(ball: isowave.Volume, tmp_path: pathlib.Path) -> None:
    file = tmp_path / "scene.json"
    with pytest.raises(isowave.Error, match="give at least one"):
        ball.scene().save(file)
    with pytest.raises(isowave.Error, match="png"):
        one(ball).save(tmp_path / "scene.png")
    with pytest.raises(ValueError, match="lights sun: there are ambient, diffuse"):
        ball.scene().surface(3).look(lights={"sun": 1}).render(size=SIZE)
    with pytest.raises(TypeError, match="unexpected keyword argument 'colour'"):
        ball.scene().look(colour="red")
    one(ball).save(file)
    with pytest.raises(isowave.Error, match="scene.json: it names no volume"):
        isowave.open_scene(file)
    with pytest.raises(TypeError, match="exact: the volume is open already"):
        isowave.open_scene(file, volume=ball, exact=True)
    with pytest.raises(isowave.Error, match="annotations.units: 17 letters are too many"):
        one(ball).annotate(units=17 * "µ").save(file)
    with pytest.raises(isowave.Error, match="annotations.color_bar: there is no colour map"):
        one(ball).annotate("color-bar").save(file)
    file.write_text(
        '{"isowave_scene": 1, "surfaces": [{"isovalue": 1}], "annotations": {"bar": 1}}'
    )
    with pytest.raises(isowave.Error, match='scene.json: annotations has no "bar"'):
        isowave.open_scene(file, volume=ball)
    file.write_text('{"isowave_scene": 1, "surfaces": [{"isovalue": 1, "opacity": 7}]}')
    with pytest.raises(isowave.Error, match="scene.json: an opacity of 7") as caught:
        isowave.open_scene(file, volume=ball)
    assert "\n" not in str(caught.value)


def test_scenes_keep_the_part_of_a_file(tmp_path: pathlib.Path) -> None:
    """Dataset and index of volume and field, from the file that these were opened from."""
    h5py = pytest.importorskip("h5py")
    z, y, x = np.mgrid[0:9, 0:10, 0:11]
    voxels = np.stack([z + 2 * y + x * t for t in range(3)]).astype(np.float32)
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["a/ct"], file["a/heat"] = voxels, voxels[:, ::-1]
    parts: Any = {"dataset": "a/ct", "index": {"t": 2}}
    volume = isowave.open(tmp_path / "run.h5", **parts)
    heat = isowave.open(tmp_path / "run.h5", dataset="a/heat", index="t=1")
    by_field = isowave.ColorMap("magma", by="field")
    scene = volume.scene().surface(20).look(color_map=by_field, field=heat)
    file = tmp_path / "scene.json"
    of_field = {"field_dataset": "a/heat", "field_index": "t=1"}
    given = {"dataset": "a/ct", "index": "t=2", **of_field}
    name = tmp_path / "run.h5"
    scene.save(file)
    saved = isowave._core.read_scene(str(file))
    assert saved["volume"] == saved["field"] == str(name)
    assert {key: saved[key] for key in given} == given
    text = file.read_text()
    scene.save(file, volume=name, field=name, **given)  # type: ignore[arg-type]
    assert isowave._core.read_scene(str(file)) == saved
    read = isowave.open_scene(file)
    assert np.array_equal(picture(read), picture(scene)) and read.field is not read.volume
    read.save(file)
    assert file.read_text() == text
    # Arguments choose others.
    other: Any = isowave.open_scene(file, index="t=1")
    assert (other.volume.source.dataset, other.volume.source.index) == ("a/ct", "t=1")
    # A pickled volume knows it, too; what was made of an array does not.
    assert pickle.loads(pickle.dumps(volume)).source == volume.source
    assert isowave.compress(voxels[0]).source is None
    scene.save(file, volume=tmp_path / "other.h5")
    assert isowave._core.read_scene(str(file))["dataset"] == "", "that of another file"
    with pytest.raises(isowave.Error, match="dataset: the scene names no file of the volume"):
        isowave.compress(voxels[0]).scene().surface(3).save(file, dataset="ct")


def test_steps_of_series_know_their_file(tmp_path: pathlib.Path) -> None:
    voxels = np.arange(8 * 8 * 8 * 3).reshape(3, 8, 8, 8).astype(np.uint16)
    head = "NRRD0004\ntype: uint16\nencoding: raw\nendian: little\ndimension: 4\nsizes: 8 8 8 3\n\n"
    four = tmp_path / "four.nrrd"
    four.write_bytes(head.encode() + voxels.tobytes())
    series = isowave.open_series(four)
    found = [series.source(step) for step in range(3)]
    assert found == [source_file(str(four), None, {"t": step}) for step in range(3)]
    assert series[1:][1].source == series[1:].source(1) == found[2]
    assert isowave.open(four, index="t=1").source == found[1]
    for step in range(2):
        isowave.compress(voxels[step]).save(tmp_path / f"s_{step}.zfp")
    files = isowave.open_series(str(tmp_path / "s_*.zfp"))
    assert files.source(1) == source_file(str(tmp_path / "s_1.zfp")) == files[1].source
    assert isowave.open_series(voxels).source(0) is None


def test_depth_follows_the_view(ball: isowave.Volume, tmp_path: pathlib.Path) -> None:
    color_map = isowave.ColorMap("magma", by="depth")
    scene = ball.scene().surface(3).look(color_map=color_map).seen_from(CAMERA)
    away = tuple(a - b for a, b in zip(CAMERA.at, CAMERA.eye))
    along = scene.look(color_map=isowave.ColorMap("magma", away))
    assert np.array_equal(picture(scene), picture(along))
    scene.save(tmp_path / "scene.json")
    read = isowave.open_scene(tmp_path / "scene.json", volume=ball)
    side = isowave.Camera((60, 8, 8), (8, 8, 8))
    turned = read.seen_from(side)
    beside = scene.look(color_map=isowave.ColorMap("magma", (-1, 0, 0))).seen_from(side)
    assert np.array_equal(picture(turned), picture(beside))
    assert not np.array_equal(picture(turned), picture(along.seen_from(side)))
