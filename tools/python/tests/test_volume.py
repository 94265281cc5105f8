"""Volumes of arrays and files as Python gets them: what is compressed, and what they say."""

import gzip
import threading
import time

import numpy as np
import pytest
from conftest import FUEL, sphere_voxels

import isowave


def test_volume_says_what_it_is(volume):
    assert volume.shape == (20, 25, 30)
    assert volume.spacing == (3, 2, 1)
    assert volume.origin == (30, 20, 10)
    assert np.array_equal(volume.direction, np.eye(3))
    assert volume.dtype == volume.source_dtype == np.float32
    voxels = sphere_voxels()
    assert volume.value_range == (voxels.min(), voxels.max())
    assert np.abs(volume.decode() - voxels).max() == pytest.approx(volume.max_error)
    assert 0 < volume.max_error <= 0.01
    assert volume.compression == "fixed accuracy"
    assert isowave.compress(voxels, rate=8).compression == "fixed rate"
    assert volume.isovalue_notice(float(voxels.mean())) == ""
    assert "any surface comes from errors" in volume.isovalue_notice(float(voxels.min()))
    assert volume.isovalue_notice(float(voxels.max()) + 1).endswith("there is no surface")
    assert volume.nbytes < voxels.nbytes
    assert np.array_equal(np.asarray(volume), volume.decode())
    assert "20 x 25 x 30" in repr(volume) and "20 x 25 x 30" in volume._repr_html_()


def test_level_shapes_are_those_that_decode_gives():
    volume = isowave.compress(sphere_voxels((20, 25, 33)), tolerance=0.01, levels=0)
    assert volume.num_levels == 3
    for level in range(volume.num_levels):
        assert volume.level_shape(level) == volume.decode(level).shape
    for level in (-1, volume.num_levels):
        with pytest.raises(ValueError, match=f"level {level} "):
            volume.level_shape(level)


INTEGERS = ["uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64"]


@pytest.mark.parametrize("dtype", INTEGERS + ["float32", "float64"])
@pytest.mark.parametrize("exact", [False, True])
def test_every_type_is_compressed_without_loss(dtype, exact):
    voxels = np.arange(5 * 4 * 3).reshape(5, 4, 3).astype(dtype)
    volume = isowave.compress(voxels, exact=exact)
    assert volume.source_dtype == np.dtype(dtype)
    assert volume.max_error == 0
    whole = np.issubdtype(voxels.dtype, np.integer)
    assert volume.compression == ("whole numbers" if whole else "reversible")
    assert np.array_equal(volume.decode(), voxels)


def test_floats_keep_their_bits_among_outliers():
    voxels = sphere_voxels()
    voxels[::5, ::7, 3] = 1e20
    voxels[3, 3] = -0.0
    voxels[4, 4] *= np.float32(1e-38)
    assert isowave.compress(voxels).decode().tobytes() == voxels.tobytes()
    doubles = voxels.astype(np.float64) / 3
    volume = isowave.compress(doubles)
    assert 0 < volume.max_error <= 1e20 / 3 * 2**-24
    with pytest.raises(isowave.Error, match="float64"):
        isowave.compress(doubles, exact=True)


def test_views_are_compressed_as_their_copies():
    base = sphere_voxels((40, 25, 30))
    for view in (base[::2], base[::-1], base.transpose(2, 1, 0), np.asfortranarray(base)):
        seen = isowave.compress(view, tolerance=0.01)
        copied = isowave.compress(np.ascontiguousarray(view), tolerance=0.01)
        assert seen.shape == view.shape
        assert np.array_equal(seen.decode(), copied.decode())


def test_files_are_those_of_the_program(program, tmp_path):
    program("convert", FUEL, "--tolerance", 0.5, "--levels", 2, "-o", tmp_path / "program.zfp")
    isowave.open(FUEL, tolerance=0.5, levels=2).save(tmp_path / "package.zfp")
    assert (tmp_path / "program.zfp").read_bytes() == (tmp_path / "package.zfp").read_bytes()
    opened = isowave.open(tmp_path / "program.zfp")
    assert opened.shape == (32, 33, 64) and opened.num_levels == 2
    assert opened.decode(1).shape == (17, 17, 33)
    for source in (FUEL, "generate:mixing_layer_12x13x14_float32"):
        program("convert", source, "-o", tmp_path / "program.zfp")
        isowave.open(source).save(tmp_path / "package.zfp")
        assert (tmp_path / "program.zfp").read_bytes() == (tmp_path / "package.zfp").read_bytes()


def test_arrays_are_compressed_into_files(tmp_path):
    voxels = sphere_voxels()
    of_file = isowave.compress(voxels, tolerance=0.01, path=tmp_path / "a.zfp")
    isowave.compress(voxels, tolerance=0.01).save(tmp_path / "b.zfp")
    assert (tmp_path / "a.zfp").read_bytes() == (tmp_path / "b.zfp").read_bytes()
    assert np.array_equal(of_file.decode(), isowave.open(tmp_path / "b.zfp").decode())
    with pytest.raises(isowave.Error, match=".zfp"):
        isowave.compress(voxels, path=tmp_path / "a.nrrd")


def test_array_and_file_are_one_volume():
    voxels = np.frombuffer(gzip.open(FUEL).read(), np.uint8).reshape(32, 33, 64)
    of_array, of_file = isowave.compress(voxels, exact=True), isowave.open(FUEL, exact=True)
    assert np.array_equal(of_array.decode(), voxels)
    assert np.array_equal(of_file.decode(), voxels)
    assert of_array.shape == of_file.shape


def test_gil_is_released_while_a_volume_is_compressed():
    turns = []
    stop = threading.Event()

    def count():
        while not stop.is_set():
            turns.append(None)
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    isowave.compress(np.random.default_rng(0).random((128, 128, 128), np.float32), tolerance=1e-3)
    stop.set()
    thread.join()
    assert len(turns) > 10


def test_progress_goes_from_nothing_to_all():
    told = {}
    isowave.compress(
        sphere_voxels(),
        tolerance=0.01,
        progress=lambda what, done: told.setdefault(what, []).append(done),
    )
    assert len(told) == 2
    for steps in told.values():
        assert steps == sorted(steps) and steps[-1] == 1

    def fail(what, done):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        isowave.compress(sphere_voxels(), tolerance=0.01, progress=fail)


def test_sources_that_fail_raise_their_own_exception():
    class Store:
        shape, dtype, ndim = (8, 8, 8), np.dtype("uint8"), 3

        def __array__(self, dtype=None, copy=None):
            raise OSError("the disk is gone")

    with pytest.raises(Exception, match="the disk is gone"):
        isowave.compress(Store())


def test_histogram_counts_all_voxels_of_a_small_volume(volume):
    counts, edges = volume.histogram(16)
    assert counts.sum() == 20 * 25 * 30
    # Decoded values just beyond the ends belong to the last bins.
    values = np.clip(volume.decode(), *volume.value_range)
    expected, expected_edges = np.histogram(values, 16, volume.value_range)
    assert np.allclose(edges, expected_edges) and np.array_equal(counts, expected)
