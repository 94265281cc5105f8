"""Voxels without data, from arrays of every kind: no surface touches them."""

import numpy as np
import pytest

import isowave

SHAPE = (20, 18, 22)
HOLE = np.s_[6:9, :, 4:7]


def ramp(dtype="f4"):
    z, y, x = np.indices(SHAPE)
    return (x + 2 * y + 3 * z).astype(dtype)


def holed(value, dtype="f4"):
    array = ramp(dtype)
    array[HOLE] = value
    return array


def missing(volume):
    return np.isnan(np.asarray(volume[...]))


def expected():
    mask = np.zeros(SHAPE, bool)
    mask[HOLE] = True
    return mask


@pytest.mark.parametrize(
    "array, options",
    [
        (holed(np.nan), {}),
        (holed(1e20), {"no_data": 1e20}),
        (holed(np.inf), {"no_data": np.inf}),
        (holed(-1, "i2"), {"no_data": -1, "exact": True}),
        (np.ma.array(ramp("u1"), mask=expected()), {}),
        (np.ma.array(ramp(), mask=expected()), {}),
    ],
    ids=["nan", "value", "inf", "int16", "masked uint8", "masked float32"],
)
def test_voxels_of_any_kind(array, options):
    volume = isowave.compress(array, **options)
    np.testing.assert_array_equal(missing(volume), expected())
    low, high = volume.value_range
    assert 0 <= low and high <= ramp().max()


def test_meshes_have_no_triangle_there():
    whole = isowave.compress(ramp(), tolerance=1e-3).extract(60.5)
    mesh = isowave.compress(holed(np.nan), tolerance=1e-3).extract(60.5)
    assert 0 < len(mesh.faces) < len(whole.faces)
    x, _, z = mesh.vertices.T
    assert not ((x > 3) & (x < 7) & (z > 5) & (z < 9)).any()


def test_levels_of_detail_are_made_of_the_others():
    volume = isowave.compress(holed(np.nan), levels=2)
    coarse = np.asarray(volume.levels[1][...])
    mask = np.zeros(coarse.shape, bool)
    mask[3:5, :, 2:4] = True  # voxels 6, 8 and 4, 6, which lie between no two with data
    np.testing.assert_array_equal(np.isnan(coarse), mask)
    whole = np.asarray(isowave.compress(ramp(), levels=2).levels[1][...])
    np.testing.assert_array_equal(coarse[:, :, 5:], whole[:, :, 5:])
    assert 0 < len(volume.extract(60.5, level=1).faces)


def test_files_say_it(tmp_path):
    path = tmp_path / "a_22x18x20_float32.raw"
    path.write_bytes(holed(-9).tobytes())
    np.testing.assert_array_equal(missing(isowave.open(path, no_data=-9)), expected())
    packed = isowave.compress(holed(-9), no_data=-9, path=tmp_path / "a.zfp")
    np.testing.assert_array_equal(missing(packed), expected())
    np.testing.assert_array_equal(missing(isowave.open(tmp_path / "a.zfp")), expected())


def test_labels_of_packages():
    xarray = pytest.importorskip("xarray")
    array = xarray.DataArray(holed(-9), dims=("z", "y", "x"), attrs={"_FillValue": -9.0})
    np.testing.assert_array_equal(missing(isowave.compress(array)), expected())
    assert not missing(isowave.compress(array, no_data=-8)).any()


def test_stores_say_it(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        dataset = file.create_dataset("a", data=holed(-9, "i2"), fillvalue=-9)
        np.testing.assert_array_equal(missing(isowave.compress(dataset)), expected())
        assert not missing(isowave.compress(dataset, no_data=-8)).any()


@pytest.mark.parametrize("dtype", ["u1", "i4", "f4"])
def test_lazy_masks(dtype):
    dask_array = pytest.importorskip("dask.array")
    lazy = dask_array.from_array(np.ma.array(ramp(dtype), mask=expected()), chunks=(7, 9, 22))
    volume = isowave.compress(lazy)
    np.testing.assert_array_equal(missing(volume), expected())
    np.testing.assert_array_equal(volume[...][~expected()], ramp(dtype)[~expected()])


def test_what_cannot_be():
    with pytest.raises(isowave.Error, match="(is|are) infinite, the first at x="):
        isowave.compress(holed(np.inf))
    with pytest.raises(isowave.Error, match="give one of the two"):
        isowave.compress(holed(np.inf), no_data=np.inf, map_nan=0)
    with pytest.raises(TypeError, match="no_data"):
        isowave.compress(holed(np.nan), no_data="5")
    assert not missing(isowave.compress(holed(np.nan), map_nan=0)).any()
