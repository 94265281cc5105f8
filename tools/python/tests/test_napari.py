"""napari: the reader as npe2 finds it, layers in a viewer (without Qt), isosurfaces."""

import subprocess
import sys
import types

import numpy as np
import pytest
from conftest import RecordingCore, sphere_voxels

npe2 = pytest.importorskip("npe2", reason="npe2 is not installed")
components = pytest.importorskip("napari.components", reason="napari is not installed")

import isowave  # noqa: E402
from isowave import napari as ours  # noqa: E402

SHAPE = (40, 45, 50)
SPACING = (3, 2, 1)
ORIGIN = (30, 20, 10)
MIDDLE = [(n - 1) / 2 for n in SHAPE]


def make_volume(**options):
    return isowave.compress(
        sphere_voxels(SHAPE), tolerance=1e-3, levels=0, spacing=SPACING, origin=ORIGIN, **options
    )


@pytest.fixture(scope="module")
def volume():
    return make_volume()


@pytest.fixture
def path(volume, tmp_path):
    volume.save(tmp_path / "ball.zfp")
    return str(tmp_path / "ball.zfp")


@pytest.fixture
def viewer():
    return components.ViewerModel()


@pytest.fixture
def viewer_3d(viewer):
    viewer.dims.ndisplay = 3
    camera = camera_of(viewer)
    camera.center = tuple(o + s * m for o, s, m in zip(ORIGIN, SPACING, MIDDLE))
    camera.zoom = 4
    camera.set_view_direction((1, 0.5, 0.3), (0, -1, 0))
    return viewer


@pytest.fixture
def plugin(npe2pm):
    """By the entry point and the manifest of the installed package."""
    with npe2pm.tmp_plugin(package="isowave"):
        yield npe2pm


def camera_of(viewer):
    return getattr(viewer, "scene", viewer).camera


def test_npe2_reads_a_file(plugin, volume, path):
    [(levels, attributes, kind)] = npe2.read([path], stack=False, plugin_name="isowave")
    assert kind == "image" and attributes["name"] == "ball"
    assert attributes["multiscale"] and "affine" not in attributes
    assert tuple(attributes["scale"]) == SPACING
    assert tuple(attributes["translate"]) == ORIGIN
    assert attributes["contrast_limits"] == list(volume.value_range)
    assert np.array_equal(np.asarray(levels[0]), volume.decode())


@pytest.mark.parametrize("name", ["a.zfp", "a.nrrd", "a.mha", "a.nii", "a.nii.gz"])
def test_npe2_offers_the_reader(plugin, name, tmp_path):
    (tmp_path / name).touch()
    readers = plugin.iter_compatible_readers([str(tmp_path / name)])
    assert "isowave" in [reader.plugin_name for reader in readers]


def nrrd(path, voxels, kind):
    sizes = " ".join(str(n) for n in reversed(voxels.shape))
    header = f"NRRD0004\ntype: {kind}\ndimension: 3\nsizes: {sizes}\nspacings: 1 2 3\n"
    path.write_bytes(f"{header}endian: little\nencoding: raw\n\n".encode() + voxels.tobytes())
    return str(path)


def test_other_files_are_read_exactly_or_nearly(tmp_path):
    rng = np.random.default_rng(1)
    integers = rng.integers(0, 60000, (20, 24, 28)).astype("<u2")
    [(levels, attributes, _)] = ours.read(nrrd(tmp_path / "i.nrrd", integers, "uint16"))
    assert np.array_equal(levels[0][...], integers)
    assert attributes["name"] == "i" and tuple(attributes["scale"]) == SPACING
    floats = rng.normal(size=(20, 24, 28)).astype("<f4")
    [(levels, _, _)] = ours.read(nrrd(tmp_path / "f.nrrd", floats, "float"))
    assert np.abs(levels[0][...] - floats).max() <= np.ptp(floats) * 2**-16
    floats[3, 4, 5:8] = np.nan  # no data there
    [(levels, _, _)] = ours.read(nrrd(tmp_path / "holes.nrrd", floats, "float"))
    assert np.array_equal(np.isnan(levels[0][...]), np.isnan(floats))


def test_bad_files_get_one_line(tmp_path):
    assert ours.get_reader(["a.zfp", "b.zfp"]) is None
    (tmp_path / "bad.zfp").write_bytes(b"no volume")
    (tmp_path / "bad.nrrd").write_bytes(b"no volume")
    for name in ("none.zfp", "bad.zfp", "none.nrrd", "bad.nrrd"):
        with pytest.raises(isowave.Error) as raised:
            ours.read(str(tmp_path / name))
        assert "\n" not in str(raised.value) and name in str(raised.value)


def recorded(volume):
    """The same volume; how many blocks each decoding takes is in ._core.blocks."""
    return isowave.Volume(RecordingCore(volume._core))


def test_slices_decode_their_own_blocks(volume):
    volume = recorded(volume)
    levels = ours.levels_of(volume, texture=1)
    assert len(levels) == volume.num_levels == 4
    assert [level.shape for level in levels] == [SHAPE, (20, 23, 25), (10, 12, 13), (5, 6, 7)]
    assert volume._core.blocks == []
    z, y, x = levels[1].shape
    assert np.array_equal(levels[1][4], volume.decode(1)[4, :y, :x])
    assert volume._core.blocks == [6 * 7, 6 * 6 * 7]
    assert not any(level.is_kept for level in levels)
    for k, level in enumerate(levels):
        z, y, x = level.shape
        assert level.ndim == 3 and level.size == z * y * x and len(level) == z
        voxels = np.asarray(level)
        assert voxels.dtype == level.dtype == np.float32
        assert np.array_equal(voxels, volume.decode(k)[:z, :y, :x])


def test_boxes_are_decoded_when_they_are_indexed(volume):
    volume = recorded(volume)
    level, voxels = ours.levels_of(volume)[0], volume.decode()
    volume._core.blocks.clear()
    box = level[2:30, ::3, 5:]
    assert box.shape == (28, 15, 45) and box.dtype == np.float32 and volume._core.blocks == []
    assert np.array_equal(box[7], voxels[9, ::3, 5:])
    assert np.array_equal(box[-1, ::-2, 1:9:3], voxels[29, ::3, 5:][::-2, 1:9:3])
    assert volume._core.blocks == [11 * 12, 8 * 3]
    assert np.array_equal(np.asarray(box), voxels[2:30, ::3, 5:])
    assert level[5:5, :, :][0:3].shape == (0, 45, 50)


def test_whole_levels_are_kept(volume):
    volume = recorded(volume)
    level = ours.levels_of(volume)[0]
    whole = level[...]
    assert level.is_kept and volume._core.blocks == [10 * 12 * 13]
    assert isinstance(whole, np.ndarray) and np.array_equal(whole, np.asarray(level))
    assert np.array_equal(level[3, ::-2], whole[3, ::-2])
    assert volume._core.blocks == [10 * 12 * 13]
    with pytest.raises(ValueError, match="read-only"):
        whole[0, 0, 0] = 1


def test_the_layer_ends_with_the_first_level_that_fits_a_texture(volume):
    assert len(ours.levels_of(volume)) == 1
    for k in range(volume.num_levels):
        size = ours.ShownLevel(volume, k).size
        assert len(ours.levels_of(volume, texture=size)) == k + 1
        assert len(ours.levels_of(volume, texture=size - 1)) == min(k + 2, volume.num_levels)


def test_a_side_longer_than_textures_have_is_halved():
    volume = isowave.compress(np.zeros((9, 9, 2049), np.uint8), exact=True, levels=0)
    assert [level.shape for level in ours.levels_of(volume)] == [(9, 9, 2049), (5, 5, 1025)]


def test_a_viewer_opens_a_file(plugin, viewer, path):
    [layer] = viewer.open(path, plugin="isowave")
    assert layer.name == "ball" and layer.multiscale
    assert tuple(layer.scale) == SPACING and tuple(layer.translate) == ORIGIN
    viewer.dims.ndisplay = 3
    assert layer.data[layer.data_level].shape == SHAPE  # not a coarse level: all fits a texture


def test_a_viewer_decodes_what_it_shows(viewer, volume):
    volume = recorded(volume)
    layer = ours.add_volume(viewer, volume, texture=10 * 12 * 13, name="ball", colormap="bone")
    assert layer.name == "ball" and layer.colormap.name == "bone"
    # napari begins with a slice of the coarsest level, which has 3 x 3 x 4 blocks.
    assert volume._core.blocks and max(volume._core.blocks) <= 3 * 4
    volume._core.blocks.clear()
    layer.data_level = 0
    layer.corner_pixels = np.array([[0, 0, 0], [39, 44, 49]])
    volume._core.blocks.clear()
    viewer.dims.set_current_step(0, 5)
    assert volume._core.blocks == [12 * 13, 3 * 4]  # of one slice; the thumbnail's
    assert np.array_equal(layer._slice.image.raw, volume[5])
    layer.corner_pixels = np.array([[0, 8, 0], [39, 15, 3]])
    layer.refresh()
    assert volume._core.blocks[-2:] == [2 * 1, 3 * 4]
    viewer.dims.order = (2, 0, 1)
    layer.data_level = 0
    layer.corner_pixels = np.array([[0, 0, 0], [39, 44, 49]])
    volume._core.blocks.clear()
    viewer.dims.set_current_step(2, 49)
    assert volume._core.blocks == [10 * 12, 3 * 3]
    viewer.dims.order = (0, 1, 2)
    assert not any(level.is_kept for level in layer.data)
    viewer.dims.ndisplay = 3
    assert layer.data_level == 2
    assert [level.is_kept for level in layer.data] == [False, False, True]
    # napari places voxel k of a level by these; 45 and 50 are not multiples of 4.
    factors = layer.downsample_factors
    assert factors[2, 0] == 4 and np.array_equal(factors[1, [0, 2]], [2, 2])
    for k, level in enumerate(layer.data):
        last = np.array(level.shape) - 1
        assert (np.abs(last * (factors[k] - 2**k)) < 2**k).all()


def test_directions_turn_the_layer(viewer):
    c, s = np.cos(0.3), np.sin(0.3)
    direction = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array(
        [[1, 0, 0], [0, c, -s], [0, s, c]]
    )
    volume = make_volume(direction=direction)
    layer = ours.add_volume(viewer, volume)
    assert tuple(layer.scale) == SPACING and tuple(layer.translate) == ORIGIN
    for index in [(0, 0, 0), (39, 0, 0), (0, 44, 0), (0, 0, 49), (7, 11, 13)]:
        xyz = np.array(ORIGIN[::-1]) + direction @ (np.array(index) * SPACING)[::-1]
        # Errors of float64, of values up to 200.
        assert np.allclose(layer.data_to_world(index), xyz[::-1], rtol=0, atol=1e-12)


def test_cameras_see_what_the_viewer_shows(viewer_3d):
    camera = camera_of(viewer_3d)
    camera.center, camera.zoom, camera.perspective = (3, 2, 1), 2, 90
    camera.set_view_direction((1, 0, 0), (0, -1, 0))
    # 200 pixels are 100 units of the world, which 90 degrees see from 50.
    seen = ours.camera_of(camera, 200)
    assert seen.fovy == 90
    assert np.allclose(seen.at, (1, 2, 3), rtol=0, atol=1e-12)
    assert np.allclose(seen.eye, (1, 2, -47), rtol=0, atol=1e-12)
    assert np.allclose(seen.up, (0, -1, 0), rtol=0, atol=1e-12)
    camera.perspective = 0
    seen = ours.camera_of(camera, 200)
    assert np.isclose(np.tan(np.radians(seen.fovy / 2)) * (3 - seen.eye[2]), 50, rtol=1e-12)


def test_isosurface_is_where_the_volume_has_it(viewer_3d, volume):
    camera = ours.camera_of(camera_of(viewer_3d), 240)
    layer = ours.add_isosurface(viewer_3d, volume, 10, size=(320, 240))
    assert ours.camera_of(camera_of(viewer_3d), 240) == camera
    vertices, faces, _ = layer.data
    assert len(vertices) > 1000 and np.array_equal(np.unique(faces), np.arange(len(vertices)))
    offset = (vertices - np.array(ORIGIN)) / SPACING - MIDDLE
    # A trilinear field is off by at most 1/8 of the second derivatives, 1/r each, along three axes,
    # r at least 10 less a cell's diagonal; the voxels by 1e-3.
    radius = np.linalg.norm(offset, axis=1)
    assert np.abs(radius - 10).max() <= 3 / 8 / (10 - np.sqrt(3)) + 2e-3
    # Only the side of the camera, but for cells at the silhouette, whose normals differ by their
    # diagonal over the radius, and for the angle of the view.
    normal = offset / SPACING
    normal /= np.linalg.norm(normal, axis=1)[:, np.newaxis]
    away = normal @ camera_of(viewer_3d).view_direction
    assert away.max() < np.sqrt(3) / 10 + np.sin(np.radians(ours.NARROW_VIEW / 2))
    # The picture's colours.
    image = volume.render(10, size=(320, 240), camera=camera)
    colors = np.unique(np.rint(255 * np.asarray(layer.vertex_colors)[:, :3]), axis=0)
    assert {tuple(c) for c in colors} <= {tuple(c) for c in image.rgb[image.rgba[..., 3] > 0]}
    # Pixels along the outline may have no triangle; those inside have.
    hits = np.isfinite(image.depth).sum()
    assert 0.95 * hits < len(vertices) <= hits


def test_isosurface_is_replaced_by_the_next(viewer_3d, volume):
    layer = ours.add_isosurface(viewer_3d, volume, 10, size=(320, 240), name="skin")
    before = len(layer.data[0])
    camera_of(viewer_3d).perspective = 40
    assert ours.add_isosurface(viewer_3d, volume, 5, size=(320, 240), name="skin") is layer
    assert len(viewer_3d.layers) == 1
    assert 0 < len(layer.data[0]) == len(layer.vertex_colors) < before


def test_isosurface_says_what_it_needs(viewer, volume):
    with pytest.raises(ValueError, match="in 3D"):
        ours.add_isosurface(viewer, volume, 10)
    viewer.dims.ndisplay = 3
    camera_of(viewer).center = ORIGIN
    with pytest.raises(ValueError, match="no surface of value 5000"):
        ours.add_isosurface(viewer, volume, 5000, size=(64, 48))
    viewer.dims.order = (1, 0)
    with pytest.raises(ValueError, match="in 3D"):
        ours.add_isosurface(viewer, volume, 10)
    assert len(viewer.layers) == 0


def picture(depth):
    depth = np.asarray(depth, np.float32)
    rows, columns = np.mgrid[: depth.shape[0], : depth.shape[1]]
    return types.SimpleNamespace(
        rgb=np.zeros((*depth.shape, 3), np.uint8),
        depth=depth,
        position=np.dstack((columns, rows, depth)).astype(np.float32),
        camera=isowave.Camera((0, 0, 0), (0, 0, 1), fovy=60),
    )


def test_meshes_are_cut_where_the_depth_steps():
    height, width = 100, 8
    depth = np.full((height, width), 2.0)
    vertices, faces, colors = ours.mesh_of(picture(depth))
    assert len(vertices) == len(colors) == height * width
    assert len(faces) == 2 * (height - 1) * (width - 1)
    assert np.array_equal(vertices[faces[0]], [[2, 0, 0], [2, 1, 0], [2, 0, 1]])  # z, y, x
    pixel = 2 * np.tan(np.radians(30)) / height * 2  # at depth 2
    for step, columns in [(9.9 * pixel, width - 1), (10.1 * pixel, width - 2)]:
        depth[:, 4:] = 2 + step
        assert len(ours.mesh_of(picture(depth))[1]) == 2 * (height - 1) * columns
    depth[:, 4:] = np.inf
    vertices, faces, _ = ours.mesh_of(picture(depth))
    assert len(vertices) == height * 4 and len(faces) == 2 * (height - 1) * 3


def test_the_module_does_not_import_napari():
    code = "import sys, isowave.napari; assert 'napari' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
