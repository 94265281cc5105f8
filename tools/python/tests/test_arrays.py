"""Arrays of every package through as_source(): voxels, grids, chunks, errors.

Packages that are not installed are skipped. Sides and spacings are unequal everywhere, so that
swapped axes fail. ISOWAVE_PROGRAM is the built program, whose NIfTI reader nibabel's must equal.
"""

import array as array_module
import itertools
import json
import os
import pathlib
import re
import subprocess
import sys
import weakref

import numpy as np
import pytest

from isowave._arrays import ArraySource, as_source

NZ, NY, NX = 7, 5, 3
SPACING = (3.0, 0.5, 2.0)  # z, y, x
ORIGIN = (10.0, -20.0, 30.0)  # z, y, x
SLABS = (4, 5, 32, None)  # None: all layers at once


def make_voxels(dtype="int16", shape=(NZ, NY, NX), seed=0):
    rng = np.random.default_rng(seed)
    kind = np.dtype(dtype).kind
    if kind == "b":
        return rng.integers(0, 2, shape).astype(bool)
    if kind == "f":
        return rng.normal(size=shape).astype(dtype)
    return rng.integers(-100 if kind == "i" else 0, 100, shape).astype(dtype)


def make_direction():
    """A rotation about no axis of the world."""
    rotation, _ = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))
    return rotation


def read_all(source, layers=None):
    layers = layers or source.shape[0]
    slabs = []
    for begin in range(0, source.shape[0], layers):
        slab = source.read(begin, min(begin + layers, source.shape[0]))
        assert slab.flags.c_contiguous and slab.dtype == source.dtype
        assert slab.dtype.isnative
        slabs.append(slab)
    return np.concatenate(slabs)


def world(source, z, y, x):
    """Position (x, y, z) of a voxel, by the definition that python users read."""
    step = np.array(source.spacing[::-1]) * np.array([x, y, z], dtype=float)
    return np.array(source.origin[::-1]) + source.direction @ step


def check_source(source, expected, **grid):
    """Voxels equal, whatever slabs they come in, and a grid as given, else the unit one."""
    assert isinstance(source, ArraySource)
    assert source.shape == expected.shape
    for layers in SLABS:
        np.testing.assert_array_equal(read_all(source, layers), expected)
    assert source.spacing == grid.get("spacing", (1.0, 1.0, 1.0))
    assert source.origin == grid.get("origin", (0.0, 0.0, 0.0))
    np.testing.assert_array_equal(source.direction, grid.get("direction", np.eye(3)))
    assert not source.direction.flags.writeable


def check_refused(obj, *texts, error=ValueError, read=False, **options):
    """One line of that type, with all of these texts."""
    with pytest.raises(error) as caught:
        source = as_source(obj, **options)
        if read:
            read_all(source)
    message = str(caught.value)
    assert "\n" not in message and len(message) < 500
    for text in texts:
        assert text in message


# numpy ------------------------------------------------------------------------------------------

KEPT = ["uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64"]
KEPT += ["uint64", "int64"]
READ_AS = {"bool": "uint8", "float16": "float32"}


@pytest.mark.parametrize("dtype", KEPT + list(READ_AS))
@pytest.mark.parametrize("order", ["=", "<", ">"])
def test_types_and_byte_orders(dtype, order):
    voxels = make_voxels(dtype)
    source = as_source(voxels.astype(voxels.dtype.newbyteorder(order)))
    assert source.dtype == np.dtype(READ_AS.get(dtype, dtype))
    check_source(source, voxels.astype(READ_AS.get(dtype, dtype)))


def strided():
    voxels = make_voxels()
    yield "fortran", np.asfortranarray(voxels), voxels
    yield "transposed", np.ascontiguousarray(voxels.T).T, voxels
    yield "reversed", voxels[::-1, ::-1, ::-1], voxels[::-1, ::-1, ::-1].copy()
    large = make_voxels(shape=(2 * NZ, 3 * NY, 4 * NX))
    yield "stepped", large[::2, ::3, ::4], large[::2, ::3, ::4].copy()
    yield "broadcast", np.broadcast_to(voxels[:1], voxels.shape), np.repeat(voxels[:1], NZ, 0)
    frozen = voxels.copy()
    frozen.setflags(write=False)
    yield "read-only", frozen, voxels
    packed = np.zeros(voxels.shape, dtype=[("a", "u1"), ("b", "<i2")])
    packed["b"] = voxels
    yield "unaligned field", packed["b"], voxels


@pytest.mark.parametrize(
    "name, given, expected", list(strided()), ids=lambda v: v if type(v) is str else ""
)
def test_strides(name, given, expected):
    check_source(as_source(given), expected)


def test_contiguous_memory_is_not_copied():
    voxels = make_voxels("float32")
    assert np.shares_memory(as_source(voxels).read(2, 6), voxels)


def test_memory_map(tmp_path):
    voxels = make_voxels()
    voxels.tofile(tmp_path / "v.raw")
    check_source(as_source(np.memmap(tmp_path / "v.raw", "int16", "r", 0, voxels.shape)), voxels)


def test_grid_of_the_caller():
    direction = make_direction()
    source = as_source(make_voxels(), spacing=SPACING, origin=ORIGIN, direction=direction)
    check_source(source, make_voxels(), spacing=SPACING, origin=ORIGIN, direction=direction)
    assert as_source(make_voxels(), spacing=2).spacing == (2.0, 2.0, 2.0)
    np.testing.assert_allclose(world(source, 0, 0, 1) - world(source, 0, 0, 0), 2 * direction[:, 0])
    np.testing.assert_allclose(world(source, 1, 0, 0) - world(source, 0, 0, 0), 3 * direction[:, 2])


@pytest.mark.parametrize("dtype", ["complex64", "datetime64[s]", "U3", "S2", "O", "longdouble"])
def test_types_that_are_refused(dtype):
    check_refused(np.zeros((NZ, NY, NX), dtype), "numpy.ndarray", error=TypeError)


def test_structured_voxels_name_a_field():
    voxels = np.zeros((NZ, NY, NX), [("density", "f4"), ("b", "u1")])
    check_refused(voxels, "array['density']", error=TypeError)


@pytest.mark.parametrize(
    "shape, text",
    [
        ((), "need 3 axes"),
        ((5,), "need 3 axes (z, y, x)"),
        ((5, 3), "shape (5, 3): need 3 axes"),
        ((1, 7, 5, 3), "pass array[0]"),
        ((7, 5, 3, 1), "pass array[..., 0]"),
        ((1, 1, 7, 5, 3), "pass array[0, 0]"),
        ((1, 7, 5, 3, 1), "pass array[0, ..., 0]"),
        ((7, 1, 5, 3), "squeeze()"),
        ((2, 7, 5, 6), "for example array[0]"),
        ((9, 7, 5, 3), "pass one channel: array[..., 0]"),
        ((2, 2, 7, 5, 3), "for example array[0, 0]"),
        ((20, 22, 24, 3), "pass one channel: array[..., 0]"),
        ((3, 22, 24, 20), "for example array[0]"),
        ((0, 5, 3), "0 voxels along z"),
        ((7, 1, 3), "1 voxels along y"),
        ((7, 5, 0), "0 voxels along x"),
        ((65537, 2, 2), "65537 voxels along z"),
    ],
)
def test_shapes_that_are_refused(shape, text):
    check_refused(np.zeros(shape, np.uint8), text)


def test_the_largest_axis():
    assert as_source(np.zeros((65536, 2, 2), np.uint8)).shape == (65536, 2, 2)


@pytest.mark.parametrize(
    "options, text",
    [
        ({"spacing": (1, 0, 1)}, "spacing (1, 0, 1)"),
        ({"spacing": (1, -2, 1)}, "above 0"),
        ({"spacing": (1, np.nan, 1)}, "finite"),
        ({"spacing": (1, np.inf, 1)}, "finite"),
        ({"spacing": (1, 2)}, "need 3 numbers"),
        ({"spacing": (1, 2, 3, 4)}, "need 3 numbers"),
        ({"spacing": "123"}, "need 3 numbers"),
        ({"spacing": ("1", "2", "3")}, "not a number"),
        ({"spacing": True}, "need 3 numbers"),
        ({"spacing": {1, 2, 3}}, "need 3 numbers"),
        ({"spacing": 1j}, "need 3 numbers"),
        ({"spacing": (10**400, 1, 1)}, "finite"),
        ({"spacing": [[1], [2], [3]]}, "not a number"),
        ({"origin": (1, np.nan, 1)}, "origin"),
        ({"origin": 1}, "origin"),
        ({"direction": np.eye(2)}, "direction"),
        ({"direction": np.eye(4)}, "direction"),
        ({"direction": np.zeros((3, 3))}, "length 0"),
        ({"direction": 2 * np.eye(3)}, "lengths belong to spacing"),
        ({"direction": [[1, 1, 0], [0, 0, 0], [0, 0, 1]]}, "singular"),
        ({"direction": np.full((3, 3), np.nan)}, "finite"),
        ({"fill_value": "a"}, "fill_value"),
        ({"fill_value": 70000}, "not a value of int16"),
        ({"fill_value": 0.5}, "not a value of int16"),
        ({"fill_value": np.nan}, "finite"),
    ],
)
def test_options_that_are_refused(options, text):
    check_refused(make_voxels(), text, **options)


def test_layers_that_do_not_exist():
    source = as_source(make_voxels())
    for begin, end in ((-1, 2), (3, 3), (4, 2), (0, 8), (7, 8)):
        with pytest.raises(ValueError, match="do not exist"):
            source.read(begin, end)
    with pytest.raises(TypeError):
        source.read(0.5, 2)


# Whole numbers of 64 bits -----------------------------------------------------------------------


@pytest.mark.parametrize("dtype", ["int64", "uint64", ">i8", ">u8"])
def test_64_bits_exact_values(dtype):
    limits = np.iinfo(dtype)
    values = [0, 1, 2**53, 2**53 + 2, 2**60, 2**62 + 2**10, 255]
    values += (
        [2**63, 2**64 - 2**11]
        if limits.min == 0
        else [-(2**53), -(2**63), -(2**53) - 2]
    )
    voxels = make_voxels("uint8").astype(dtype)
    voxels.ravel()[: len(values)] = values
    got = read_all(as_source(voxels), 4)
    assert got.dtype == np.dtype(dtype).newbyteorder("=")
    assert [int(value) for value in got.ravel()] == [int(value) for value in voxels.ravel()]


@pytest.mark.parametrize(
    "dtype, value",
    [
        ("int64", 2**53 + 1),
        ("int64", -(2**53) - 1),
        ("int64", 2**63 - 1),
        ("int64", -(2**63) + 1),
        ("uint64", 2**64 - 1),
        (">u8", 2**63 + 1),
        (">i8", 2**53 + 1),
    ],
)
def test_64_bits_other_values(dtype, value):
    voxels = np.zeros((NZ, NY, NX), dtype)
    voxels[5, 2, 1] = value
    voxels[5, 2, 2] = value
    source = as_source(voxels)
    source.read(0, 5)
    for begin, end in ((4, 7), (5, 6), (0, 7)):
        with pytest.raises(ValueError, match=re.escape(f"(5, 2, 1) is {value}")):
            source.read(begin, end)


# Masks ------------------------------------------------------------------------------------------


def test_masks():
    voxels = make_voxels("float32")
    mask = np.zeros(voxels.shape, bool)
    check_source(as_source(np.ma.array(voxels)), voxels)
    check_source(as_source(np.ma.array(voxels, mask=mask)), voxels)
    mask[5, 1, 2] = True
    masked = np.ma.array(voxels, mask=mask)
    check_source(as_source(masked), np.where(mask, np.float32(np.nan), voxels))
    for fill_value in (-7, np.nan):
        expected = np.where(mask, np.float32(fill_value), voxels)
        check_source(as_source(masked, fill_value=fill_value), expected)
    np.testing.assert_array_equal(voxels, make_voxels("float32"))  # the caller's, as it was
    check_refused(masked, "not a value of float32", fill_value=1e300)


@pytest.mark.parametrize(
    ("stored", "read"), [("uint8", "f4"), ("int16", "f4"), ("uint32", "f8"), ("int64", "f8")]
)
def test_masked_whole_numbers_have_no_data(stored, read):
    voxels = make_voxels("int16").astype(stored)
    mask = np.zeros(voxels.shape, bool)
    mask[5, 1, 2] = True
    masked = np.ma.array(voxels, mask=mask)
    check_source(as_source(masked), np.where(mask, np.nan, voxels).astype(read))


def test_masked_voxels_may_be_inexact():
    voxels = np.zeros((NZ, NY, NX), np.int64)
    voxels[3, 1, 1] = 2**53 + 1
    masked = np.ma.array(voxels, mask=voxels != 0)
    assert read_all(as_source(masked, fill_value=5))[3, 1, 1] == 5


# Buffers and protocols --------------------------------------------------------------------------


def test_buffers():
    voxels = make_voxels("int16")
    check_source(as_source(memoryview(voxels)), voxels)
    cast = memoryview(bytearray(voxels.tobytes())).cast("B").cast("h", voxels.shape)
    check_source(as_source(cast), voxels)
    check_refused(b"123456", "need 3 axes")
    check_refused(array_module.array("f", [1, 2]), "need 3 axes")


def test_nested_lists():
    check_source(as_source(make_voxels().tolist()), make_voxels().astype("float64"))
    check_refused([[[1, 2], [3]]])
    check_refused([[[None] * 2] * 2] * 2, "objects", error=TypeError)


class WithArray:
    def __init__(self, voxels):
        self.voxels = voxels

    def __array__(self, dtype=None, copy=None):
        return self.voxels


class WithDlpack:
    def __init__(self, voxels, device=1):
        self.voxels, self.device = voxels, device

    def __dlpack__(self, **options):
        return self.voxels.__dlpack__(**options)

    def __dlpack_device__(self):
        return self.device, 0


class OnGpu(WithArray):
    __cuda_array_interface__ = {"shape": (NZ, NY, NX), "typestr": "<f4", "data": (1, False)}


def test_protocols():
    voxels = make_voxels("float32")
    check_source(as_source(WithArray(voxels)), voxels)
    check_source(as_source(WithDlpack(voxels)), voxels)
    check_refused(OnGpu(voxels), "GPU memory", "array.get()", error=TypeError)
    check_refused(WithDlpack(voxels, device=2), "GPU memory", error=TypeError)
    check_refused(object(), "not an array", error=TypeError)
    check_refused(None, "not an array", error=TypeError)
    check_refused("head.nrrd", "isowave.open()", error=TypeError)
    check_refused(pathlib.Path("head.nrrd"), "isowave.open()", error=TypeError)


def test_errors_of_objects_become_one_line():
    class Broken:
        def __array__(self, dtype=None, copy=None):
            raise RuntimeError("first line\nsecond line " + "x" * 1000)

    check_refused(Broken(), "RuntimeError", "first line second line")


def test_torch():
    torch = pytest.importorskip("torch")
    voxels = make_voxels("float32")
    check_source(as_source(torch.from_numpy(voxels)), voxels)
    check_refused(torch.zeros((NZ, NY, NX), requires_grad=True), "requires grad")


def test_subclasses_have_the_adapter():
    xarray = pytest.importorskip("xarray")

    class Mine(xarray.DataArray):
        __slots__ = ()

    made = Mine(make_voxels(), dims=tuple("abc"), coords={"a": np.arange(NZ) * 4.0})
    assert as_source(made).spacing == (4.0, 1.0, 1.0)


# Chunks -----------------------------------------------------------------------------------------


class CountingChunks:
    """Stands for a zarr array in memory: counts how often each chunk is fetched, and how many
    bytes of what it gave are alive."""

    __module__ = "zarr.core.array"

    def __init__(self, voxels, chunk_layers):
        self.voxels = voxels
        self.shape, self.dtype = voxels.shape, voxels.dtype
        self.chunks = (chunk_layers, 2, 2)
        self.fetched = [0] * -(-self.shape[0] // chunk_layers)
        self.alive = self.most_alive = 0

    def __getitem__(self, layers):
        begin, end = layers.start, layers.stop
        for row in range(begin // self.chunks[0], -(-end // self.chunks[0])):
            self.fetched[row] += 1
        result = self.voxels[begin:end].copy()
        self.alive += result.nbytes
        self.most_alive = max(self.most_alive, self.alive)
        weakref.finalize(result, self.release, result.nbytes)
        return result

    def release(self, num_bytes):
        self.alive -= num_bytes


CountingChunks.__name__ = "Array"


@pytest.mark.parametrize("dtype", ["int16", "float16", "int64", ">f4"])
@pytest.mark.parametrize("chunk_layers", [1, 3, 4, 7, 16, 33, 64, 100])
@pytest.mark.parametrize("slab", [1, 4, 5, 8, 32, 70])
def test_each_chunk_is_fetched_once(dtype, chunk_layers, slab):
    voxels = make_voxels(dtype, (70, 4, 3))
    store = CountingChunks(voxels, chunk_layers)
    source = as_source(store)
    assert source.chunk_layers == min(chunk_layers, 70)
    layer_bytes = 4 * 3 * voxels.dtype.itemsize
    for begin in range(0, 70, slab):
        end = min(begin + slab, 70)
        got = source.read(begin, end)
        np.testing.assert_array_equal(got, voxels[begin:end].astype(source.dtype))
        # What the store gave is one row, or whole rows that are the slab.
        assert store.most_alive <= max(min(chunk_layers, 70), slab) * layer_bytes
        del got
    assert store.fetched == [1] * len(store.fetched)
    assert store.alive == 0


@pytest.mark.parametrize("dtype", ["int16", "float16"])
@pytest.mark.parametrize("chunk_layers", [1, 4, 5, 16, 40])
@pytest.mark.parametrize("slab", [4, 5, 32, 64])
def test_memory_is_one_chunk_row_and_a_slab(dtype, chunk_layers, slab):
    """Memory of numpy's arrays, as tracemalloc counts it, while all slabs are read."""
    import tracemalloc

    side = 200  # large layers, beside which Python's own objects are small
    voxels = np.zeros((64, side, side), dtype)
    source = as_source(CountingChunks(voxels, chunk_layers))
    layer = side * side
    allowed = layer * (chunk_layers * voxels.dtype.itemsize + slab * source.dtype.itemsize)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for begin in range(0, 64, slab):
        slab_voxels = source.read(begin, min(begin + slab, 64))
        del slab_voxels
    peak = tracemalloc.get_traced_memory()[1] - before
    tracemalloc.stop()
    # A layer on its way to another type, and objects of Python.
    assert peak <= allowed + layer * source.dtype.itemsize + 20000


def test_slabs_may_come_in_any_order():
    voxels = make_voxels(shape=(20, 4, 3))
    source = as_source(CountingChunks(voxels, 6))
    for begin, end in ((4, 9), (0, 3), (17, 20), (5, 13), (0, 20), (6, 12), (1, 2)):
        np.testing.assert_array_equal(source.read(begin, end), voxels[begin:end])


def test_stores_that_break_their_word():
    class Array(CountingChunks):
        __module__ = "zarr"

        def __getitem__(self, layers):
            return self.answer

    store = Array(make_voxels(), 4)
    for answer, text in (
        (make_voxels(shape=(2, 2, 2)), "came with shape"),
        (make_voxels("float64"), "came as float64"),
        (None, "came with shape"),
    ):
        store.answer = answer
        with pytest.raises(ValueError, match=text):
            as_source(store).read(0, 7)


def test_errors_of_stores_name_the_layers():
    class Array(CountingChunks):
        __module__ = "zarr"

        def __getitem__(self, layers):
            raise OSError("disk\nfull")

    with pytest.raises(ValueError, match="layers 2 to 4 cannot be read: OSError: disk full"):
        as_source(Array(make_voxels(), 4)).read(2, 4)


# dask, zarr, h5py, tensorstore ------------------------------------------------------------------


@pytest.mark.parametrize("chunks", [4, ((2, 4, 1), 2, 3), ((7,), 5, 3), ((3, 0, 4), 5, 3), 1])
def test_dask(chunks):
    da = pytest.importorskip("dask.array")
    voxels = make_voxels()
    counts = {}

    def block(block_info=None):
        location = tuple(block_info[None]["chunk-location"])
        counts[location] = counts.get(location, 0) + 1
        (a, b), (c, d), (e, f) = block_info[None]["array-location"]
        return voxels[a:b, c:d, e:f]

    sizes = da.core.normalize_chunks(chunks, voxels.shape)
    for slab in SLABS:
        lazy = da.map_blocks(block, chunks=sizes, dtype=voxels.dtype, meta=np.empty((0,) * 3, "i2"))
        source = as_source(lazy)
        assert source.chunk_layers == max(sizes[0])
        counts.clear()
        np.testing.assert_array_equal(read_all(source, slab), voxels)
        with_layers = [place for place in counts if sizes[0][place[0]]]
        assert {counts[place] for place in with_layers} == {1}
        assert len(with_layers) == np.prod([sum(1 for n in axis if n) for axis in sizes])


def test_dask_that_is_masked_or_unknown():
    da = pytest.importorskip("dask.array")
    voxels = make_voxels()
    mask = voxels == voxels[6, 4, 2]
    lazy = da.ma.masked_equal(da.from_array(voxels, chunks=3), voxels[6, 4, 2])
    expected = np.where(mask, np.float32(np.nan), voxels)
    check_source(as_source(lazy), expected)
    check_source(as_source(lazy[2:]), expected[2:])
    check_source(as_source(lazy.astype("i4")), expected.astype("f8"))
    check_source(as_source(lazy.astype("f4")), expected)
    check_source(as_source(lazy, fill_value=1000), np.where(mask, 1000, voxels))
    # No voxel needs to be masked.
    check_source(as_source(da.ma.masked_equal(voxels, 30000)), voxels.astype("f4"))
    says_not = lazy.map_blocks(lambda block: block, meta=voxels[:0])
    check_refused(says_not, "fill_value=", read=True)
    check_source(as_source(says_not, fill_value=1000), np.where(mask, 1000, voxels))
    unknown = da.from_array(np.arange(7), chunks=3)
    unknown = unknown[unknown > 2][:, None, None] * da.ones((1, 5, 3))
    check_refused(unknown, "compute_chunk_sizes()")


def zarr_counting_store(zarr):
    class Counting(zarr.storage.MemoryStore):
        counts = {}  # of the class: zarr makes a read-only twin of its store

        async def get(self, key, *args, **kwargs):
            self.counts[key] = self.counts.get(key, 0) + 1
            return await super().get(key, *args, **kwargs)

    return Counting()


@pytest.mark.parametrize("zarr_format", [2, 3])
@pytest.mark.parametrize("slab", SLABS)
def test_zarr_fetches_each_chunk_once(zarr_format, slab):
    zarr = pytest.importorskip("zarr", minversion="3")
    voxels = make_voxels("uint16", (70, 9, 5))
    store = zarr_counting_store(zarr)
    made = zarr.create_array(
        store, shape=voxels.shape, chunks=(16, 4, 5), dtype="u2", zarr_format=zarr_format
    )
    made[:] = voxels
    source = as_source(zarr.open_array(store, mode="r"))
    assert source.chunk_layers == 16
    store.counts.clear()
    np.testing.assert_array_equal(read_all(source, slab), voxels)
    chunks = {key: count for key, count in store.counts.items() if "zarr.json" not in key}
    chunks = {key: count for key, count in chunks.items() if not key.startswith(".z")}
    assert len(chunks) == 5 * 3 * 1 and set(chunks.values()) == {1}


def test_zarr_with_shards_and_names(tmp_path):
    zarr = pytest.importorskip("zarr", minversion="3")
    voxels = make_voxels("float32", (20, 8, 6))
    group = zarr.open_group(tmp_path / "a.zarr", mode="w")
    made = group.create_array(
        "ct", shape=voxels.shape, chunks=(4, 4, 6), shards=(8, 8, 6), dtype="f4"
    )
    made[:] = voxels
    check_source(as_source(group["ct"]), voxels)
    assert as_source(made).chunk_layers == 4
    check_refused(group, "group['name']", error=TypeError)
    check_refused(group.create_array("flat", shape=(5, 3), dtype="f4"), "'/flat'", "need 3 axes")


def test_zarr_2():
    """The API of zarr 2 in a Python that has it; its arrays answer as those of zarr 3 do."""
    zarr = pytest.importorskip("zarr")
    if int(zarr.__version__.split(".")[0]) > 2:
        pytest.skip("zarr 3 is installed")
    made = zarr.array(make_voxels(), chunks=(4, 2, 3))
    check_source(as_source(made), make_voxels())
    assert as_source(made).chunk_layers == 4


def test_zarr_names_voxels_without_data(tmp_path):
    zarr = pytest.importorskip("zarr", minversion="3")
    for dtype, fill_value, expected in [("i2", -9, -9), ("i2", 0, None), ("f4", np.nan, None)]:
        made = zarr.create_array({}, shape=(7, 5, 3), dtype=dtype, fill_value=fill_value)
        assert as_source(made).no_data == expected


@pytest.mark.parametrize("chunks", [None, (4, 2, 3), (3, 5, 1)])
@pytest.mark.parametrize("dtype", ["uint16", "float16", "bool", ">i4"])
def test_h5py(tmp_path, chunks, dtype):
    h5py = pytest.importorskip("h5py")
    voxels = make_voxels(dtype)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("scan/ct", data=voxels, chunks=chunks)
    with h5py.File(tmp_path / "a.h5") as file:
        source = as_source(file["scan/ct"])
        assert source.chunk_layers == (chunks[0] if chunks else 1)
        check_source(source, voxels.astype(source.dtype))
        check_refused(file["scan"], "group['name']", error=TypeError)
        dataset = file["scan/ct"]
    check_refused(dataset, "closed")
    with pytest.raises(ValueError, match="cannot be read"):
        source.read(0, 2)


def test_h5py_that_is_refused(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        check_refused(file.create_dataset("e", data=h5py.Empty("f4")), "empty")
        check_refused(file.create_dataset("t", (2, 2, 2), h5py.string_dtype()), error=TypeError)


def test_h5py_names_voxels_without_data(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for dtype, fill_value, expected in [
            ("i2", -9, -9),
            ("u1", 255, 255),
            ("f8", np.inf, np.inf),
            ("i2", 0, None),
            ("i2", None, None),
            ("?", True, None),
            ("f4", np.nan, None),
        ]:
            name = f"{dtype} {fill_value}"
            made = file.create_dataset(name, (7, 5, 3), dtype, fillvalue=fill_value)
            assert as_source(made).no_data == expected
        made = file.create_dataset("attributes", (7, 5, 3), "f4", fillvalue=1e20)
        for name, value in [("missing_value", -9999), ("_FillValue", 0)]:
            made.attrs[name] = np.array([value], "f4")
            assert as_source(made).no_data == value
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file.attrs["_NCProperties"] = "version=2"
        ct = file.create_dataset("ct", (7, 5, 3), "i2", fillvalue=-32767)
        photo = file.create_dataset("photo", (7, 5, 3), "u1", fillvalue=255)
        assert as_source(ct).no_data == -32767
        assert as_source(photo).no_data is None
        photo.attrs["_FillValue"] = np.uint8(255)
        assert as_source(photo).no_data == 255


@pytest.mark.parametrize("driver", ["zarr", "zarr3", "n5"])
def test_tensorstore(driver):
    ts = pytest.importorskip("tensorstore")
    voxels = make_voxels("uint16", (20, 5, 3))
    spec = {"driver": driver, "kvstore": {"driver": "memory"}}
    store = ts.open(
        spec,
        create=True,
        shape=(20, 5, 3),
        dtype=ts.uint16,
        chunk_layout=ts.ChunkLayout(chunk_shape=(6, 2, 3)),
    ).result()
    store[...] = voxels
    assert as_source(store).chunk_layers == 6
    check_source(as_source(store), voxels)
    # A part has its first layer at 5, and its first chunk has one layer of that.
    check_source(as_source(store[5:18]), voxels[5:18])
    assert as_source(store[5:7]).chunk_layers == 1
    check_source(as_source(store[ts.d[0].translate_to[-3]]), voxels)
    check_source(as_source(store[::2]), voxels[::2])


@pytest.mark.parametrize("driver", ["zarr", "zarr3"])
def test_tensorstore_names_voxels_without_data(driver):
    ts = pytest.importorskip("tensorstore")
    spec = {"driver": driver, "kvstore": {"driver": "memory"}}
    for dtype, fill_value, expected in [
        (ts.int16, -9, -9),
        (ts.int16, 0, None),
        (ts.int16, None, None),
        (ts.float32, np.nan, None),
    ]:
        options = {} if fill_value is None else {"fill_value": fill_value}
        store = ts.open(spec, create=True, shape=(7, 5, 3), dtype=dtype, **options).result()
        assert as_source(store).no_data == expected
        assert as_source(store[2:]).no_data == expected


def test_tensorstore_without_chunks():
    ts = pytest.importorskip("tensorstore")
    assert as_source(ts.array(make_voxels())).no_data is None
    check_source(as_source(ts.array(make_voxels())), make_voxels())
    check_refused(ts.array(np.zeros((NZ, NY, NX), "complex64")), error=TypeError)


def test_tensorstore_fetches_each_chunk_once(tmp_path):
    """Counted by the store itself: tensorstore's metrics of file reads."""
    ts = pytest.importorskip("tensorstore")
    voxels = make_voxels("uint16", (40, 6, 5))
    spec = {"driver": "zarr3", "kvstore": {"driver": "file", "path": str(tmp_path / "t")}}
    layout = ts.ChunkLayout(chunk_shape=(6, 3, 5))
    ts.open(spec, create=True, shape=voxels.shape, dtype=ts.uint16, chunk_layout=layout).result()[
        ...
    ] = voxels

    def num_reads():
        metrics = ts.experimental_collect_matching_metrics("/tensorstore/kvstore/file/read")
        return sum(m["values"][0]["value"] for m in metrics if m["name"].endswith("/file/read"))

    for part, rows in ((slice(None), 7), (slice(4, 33), 6)):
        for slab in SLABS:
            store = ts.open(spec).result()[part]
            source = as_source(store)
            before = num_reads()
            np.testing.assert_array_equal(read_all(source, slab), voxels[part])
            assert num_reads() - before == rows * 2


# OME-Zarr ---------------------------------------------------------------------------------------


def test_ome_zarr_with_a_negative_scale():
    """Every voxel stays where the metadata says."""
    transforms = [
        {"type": "scale", "scale": [SPACING[0], -SPACING[1], SPACING[2]]},
        {"type": "translation", "translation": list(ORIGIN)},
    ]
    source = as_source(ome_group("0.5", "zyx", transforms=transforms))
    assert source.spacing == SPACING and source.origin == ORIGIN
    assert np.diag(source.direction).tolist() == [1, -1, 1]


def test_ome_zarr_with_transformations_in_any_order():
    """Each follows those before it, also those of the image those of its dataset."""
    scale = {"type": "scale", "scale": [2, 3, 4]}
    move = {"type": "translation", "translation": [10, 20, 30]}
    for transforms, shared, origin in (
        ([scale, move], None, (10, 20, 30)),
        ([move, scale], None, (20, 60, 120)),
        ([scale], [move], (10, 20, 30)),
        ([move], [scale], (20, 60, 120)),
        ([move, scale], [move], (30, 80, 150)),
    ):
        source = as_source(ome_group("0.5", "zyx", transforms=transforms, shared=shared))
        assert source.spacing == (2, 3, 4) and source.origin == origin


def ome_group(version, axes="tczyx", sizes=(1, 1), transforms=None, shared=None):
    zarr = pytest.importorskip("zarr", minversion="3")
    voxels = make_voxels("uint16")
    extra = [1 if axis not in "tc" else sizes["tc".index(axis)] for axis in axes[:-3]]
    group = zarr.create_group({}, zarr_format=2 if version == "0.4" else 3)
    shape = (*extra, *voxels.shape)
    made = group.create_array("s0", shape=shape, chunks=(*[1] * len(extra), 3, 2, 3), dtype="u2")
    made[:] = np.broadcast_to(voxels, shape)
    kinds = {"t": "time", "c": "channel"}
    metadata = {
        "axes": [{"name": axis, "type": kinds.get(axis, "space")} for axis in axes],
        "datasets": [{"path": "s0", "coordinateTransformations": transforms}],
    }
    if shared is not None:
        metadata["coordinateTransformations"] = shared
    if version == "0.4":
        group.attrs["multiscales"] = [{"version": "0.4", **metadata}]
    else:
        group.attrs["ome"] = {"version": "0.5", "multiscales": [metadata]}
    return group


@pytest.mark.parametrize("version", ["0.4", "0.5"])
@pytest.mark.parametrize("axes", ["zyx", "czyx", "tczyx"])
def test_ome_zarr(version, axes):
    extra = [1.0] * (len(axes) - 3)
    transforms = [
        {"type": "scale", "scale": [*extra, *SPACING]},
        {"type": "translation", "translation": [*extra, *ORIGIN]},
    ]
    source = as_source(ome_group(version, axes, transforms=transforms))
    check_source(source, make_voxels("uint16"), spacing=SPACING, origin=ORIGIN)
    assert source.chunk_layers == 3
    # The image's own transforms follow the dataset's.
    shared = [{"type": "scale", "scale": [*extra, 2, 4, 8]}]
    source = as_source(ome_group(version, axes, transforms=transforms, shared=shared))
    assert source.spacing == (6.0, 2.0, 16.0) and source.origin == (20.0, -80.0, 240.0)


def test_ome_zarr_of_several_channels():
    transforms = [{"type": "scale", "scale": [1, 1, *SPACING]}]
    group = ome_group("0.5", sizes=(1, 3), transforms=transforms)
    check_refused(
        group, "axis 'c' has 3 entries", "group['s0'])[0, 0, :, :, :]", "spacing=(3, 0.5, 2)"
    )


@pytest.mark.parametrize(
    "change, text",
    [
        (lambda m: m.pop("axes"), "axes is None"),
        (lambda m: m.update(axes=["z", "y", "x"]), "need a name"),
        (lambda m: m["axes"].reverse(), "need the order z, y, x"),
        (lambda m: m["axes"].pop(), "2 of them are spatial"),
        (lambda m: m["axes"].append({"name": "q", "type": "time"}), "need 4 numbers"),
        (
            lambda m: (
                m["axes"].append({"name": "q", "type": "time"}),
                m["datasets"][0].pop("coordinateTransformations"),
            ),
            "has 3 axes, its metadata 4",
        ),
        (lambda m: m.update(datasets=[]), "datasets"),
        (lambda m: m["datasets"][0].update(path="gone"), "missing"),
        (lambda m: m["datasets"][0].update(path=5), "path"),
        (
            lambda m: m["datasets"][0].update(
                coordinateTransformations=[{"type": "scale", "scale": [1, 2]}]
            ),
            "need 3 numbers",
        ),
        (
            lambda m: m["datasets"][0].update(
                coordinateTransformations=[{"type": "scale", "scale": [1, 0, 3]}]
            ),
            "above 0",
        ),
        (
            lambda m: m["datasets"][0].update(coordinateTransformations=[{"type": "affine"}]),
            "need a scale or translation",
        ),
    ],
)
def test_ome_zarr_that_is_refused(change, text):
    group = ome_group("0.5", "zyx", transforms=[{"type": "scale", "scale": SPACING}])
    metadata = dict(group.attrs["ome"])
    change(metadata["multiscales"][0])
    group.attrs["ome"] = metadata
    check_refused(group, text)


# xarray -----------------------------------------------------------------------------------------


def labelled(xarray, data=None, z=None, y=None, x=None, dims=("z", "y", "x"), **options):
    coords = {dim: c for dim, c in zip(dims, (z, y, x)) if c is not None}
    return xarray.DataArray(make_voxels() if data is None else data, coords, dims, **options)


def even(axis, falling=False):
    coordinate = ORIGIN[axis] + SPACING[axis] * np.arange((NZ, NY, NX)[axis])
    return coordinate[::-1].copy() if falling else coordinate


def test_xarray():
    xarray = pytest.importorskip("xarray")
    given = labelled(xarray, z=even(0), y=even(1), x=even(2))
    check_source(as_source(given), make_voxels(), spacing=SPACING, origin=ORIGIN)
    check_source(as_source(labelled(xarray)), make_voxels())
    # Names say which axis is which, and what has none takes the axes that are left.
    for order in itertools.permutations("zyx"):
        moved = as_source(given.transpose(*order))
        check_source(moved, make_voxels(), spacing=SPACING, origin=ORIGIN)
    for dims in (("t", "lat", "lon"), ("Z", "Y", "X"), ("k", "latitude", "i")):
        other = labelled(xarray, z=even(0), y=even(1), x=even(2), dims=dims)
        for moved in (other, other.transpose(dims[1], ...)):
            check_source(as_source(moved), make_voxels(), spacing=SPACING, origin=ORIGIN)
    plain = labelled(xarray, z=even(0), y=even(1), x=even(2), dims=("a", "b", "c"))
    check_source(as_source(plain), make_voxels(), spacing=SPACING, origin=ORIGIN)


def test_xarray_axes_of_the_cf_conventions():
    xarray = pytest.importorskip("xarray")
    given = labelled(xarray, z=even(0), y=even(1), x=even(2), dims=("a", "b", "c"))
    for dim, axis in zip("abc", "ZYX"):
        given.coords[dim].attrs["axis"] = axis
    check_source(
        as_source(given.transpose("c", "a", "b")), make_voxels(), spacing=SPACING, origin=ORIGIN
    )
    check_refused(labelled(xarray, dims=("x", "y", "lon")), "two of them are x")


def test_xarray_names_voxels_without_data():
    xarray = pytest.importorskip("xarray")
    given = labelled(xarray)
    assert as_source(given).no_data is None
    for name in ("missing_value", "_FillValue"):
        given.attrs[name] = np.array([-9999], "f4")
        assert as_source(given).no_data == -9999
    given.attrs["_FillValue"] = np.float32(np.nan)
    assert as_source(given).no_data is None
    given.attrs["_FillValue"] = "none"
    assert as_source(given).no_data is None


@pytest.mark.parametrize("falling", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)])
def test_xarray_falling_coordinates_keep_positions(falling):
    xarray = pytest.importorskip("xarray")
    z, y, x = (even(axis, falling[axis]) for axis in range(3))
    source = as_source(labelled(xarray, z=z, y=y, x=x))
    np.testing.assert_array_equal(read_all(source), make_voxels())
    assert min(source.spacing) > 0
    for index in ((0, 0, 0), (6, 4, 2), (1, 3, 2)):
        expected = [x[index[2]], y[index[1]], z[index[0]]]
        np.testing.assert_array_equal(world(source, *index), expected)


def test_xarray_coordinates_that_are_refused():
    xarray = pytest.importorskip("xarray")
    uneven = even(1)
    uneven[2] += 0.1
    check_refused(labelled(xarray, y=uneven), "coordinate 'y' is not evenly spaced")
    check_refused(labelled(xarray, y=np.zeros(NY)), "coordinate 'y' is not evenly")
    days = np.datetime64("2020-01-01", "ns") + np.arange(NZ) * np.timedelta64(1, "D")
    check_refused(labelled(xarray, z=days), "coordinate 'z'", "datetime64")
    check_refused(labelled(xarray, x=list("abc")), "coordinate 'x'", "not numbers")
    check_refused(labelled(xarray, x=[1, np.nan, 3]), "coordinate 'x'", "not finite")
    source = as_source(labelled(xarray, y=uneven, z=even(0)[::-1]), spacing=SPACING)
    assert source.spacing == SPACING
    assert source.origin == (28.0, 0.0, 0.0) and source.direction[2, 2] == -1
    rounded = np.round(np.arange(NY) / 3, 3).astype("float32")  # as files have it
    assert as_source(labelled(xarray, y=rounded)).spacing[1] == pytest.approx(1 / 3, abs=1e-3)
    check_refused(xarray.Dataset({"a": labelled(xarray)}), "group['name']", error=TypeError)
    four = xarray.DataArray(np.zeros((1, 7, 5, 3)), dims=("time", "z", "y", "x"))
    check_refused(four, ".isel(time=0)")


def test_xarray_over_dask():
    xarray, da = pytest.importorskip("xarray"), pytest.importorskip("dask.array")
    lazy = da.from_array(make_voxels(), chunks=((2, 4, 1), 5, 3))
    source = as_source(labelled(xarray, lazy, z=even(0)))
    assert source.chunk_layers == 4
    check_source(source, make_voxels(), spacing=(3.0, 1.0, 1.0), origin=(10.0, 0.0, 0.0))
    turned = as_source(labelled(xarray, lazy, z=even(0)).transpose("x", "z", "y"))
    assert turned.chunk_layers == 4
    check_source(turned, make_voxels(), spacing=(3.0, 1.0, 1.0), origin=(10.0, 0.0, 0.0))


@pytest.mark.parametrize(
    "encoding, layers",
    [
        ({"preferred_chunks": {"z": 4, "y": 5}}, 4),
        ({"preferred_chunks": {"z": 100}}, 7),
        ({"chunksizes": (3, 5, 3), "original_shape": (NZ, NY, NX)}, 3),
        ({"chunksizes": (3, 5, 3), "original_shape": (9, NY, NX)}, 1),  # of a variable cut since
        ({"chunksizes": None, "original_shape": (NZ, NY, NX)}, 1),
        ({"preferred_chunks": {"z": (4, 3)}}, 1),
        ({"preferred_chunks": {"z": 0}}, 1),
    ],
)
def test_xarray_chunks_of_a_file(encoding, layers):
    xarray = pytest.importorskip("xarray")
    given = labelled(xarray)
    given.encoding.update(encoding)
    assert as_source(given).chunk_layers == layers
    check_source(as_source(given), make_voxels())
    turned = given.transpose("x", "y", "z")
    if "original_shape" in encoding and encoding["original_shape"][0] == NZ:
        turned.encoding["original_shape"] = (NX, NY, NZ)
        turned.encoding["chunksizes"] = encoding["chunksizes"] and encoding["chunksizes"][::-1]
    assert as_source(turned).chunk_layers == layers
    check_source(as_source(turned), make_voxels())


@pytest.mark.parametrize("slab", SLABS)
def test_xarray_over_a_zarr_store(slab):
    xarray, zarr = pytest.importorskip("xarray"), pytest.importorskip("zarr", minversion="3")
    voxels = make_voxels("float32", (70, 9, 5))
    store = zarr_counting_store(zarr)
    dataset = xarray.Dataset({"ct": (("z", "y", "x"), voxels)}, {"z": np.arange(70) * 2.0})
    dataset.to_zarr(store, encoding={"ct": {"chunks": (16, 4, 5)}}, consolidated=False)
    opened = xarray.open_zarr(store, chunks=None, consolidated=False)
    source = as_source(opened["ct"])
    assert source.chunk_layers == 16 and source.spacing == (2.0, 1.0, 1.0)
    store.counts.clear()
    np.testing.assert_array_equal(read_all(source, slab), voxels)
    chunks = {key: count for key, count in store.counts.items() if "ct/c/" in key}
    assert len(chunks) == 15 and set(chunks.values()) == {1}


# SimpleITK, itk, VTK ----------------------------------------------------------------------------


def test_simpleitk():
    sitk = pytest.importorskip("SimpleITK")
    direction = make_direction()
    image = sitk.GetImageFromArray(make_voxels())
    image.SetSpacing(SPACING[::-1])
    image.SetOrigin(ORIGIN[::-1])
    image.SetDirection(direction.ravel())
    source = as_source(image)
    check_source(source, make_voxels(), spacing=SPACING, origin=ORIGIN, direction=direction)
    for z, y, x in ((0, 0, 0), (6, 4, 2), (1, 3, 2)):
        # Ten roundings at most, of terms of at most 60.
        expected = image.TransformIndexToPhysicalPoint((x, y, z))
        np.testing.assert_allclose(world(source, z, y, x), expected, atol=60 * 10 * 2**-53)
        assert source.read(z, z + 1)[0, y, x] == image[x, y, z]
    del image
    np.testing.assert_array_equal(read_all(source), make_voxels())


@pytest.mark.parametrize("dtype", KEPT)
def test_simpleitk_types(dtype):
    sitk = pytest.importorskip("SimpleITK")
    source = as_source(sitk.GetImageFromArray(make_voxels(dtype)))
    assert source.dtype == READ_AS.get(dtype, dtype)
    np.testing.assert_array_equal(read_all(source), make_voxels(dtype))


def test_simpleitk_that_is_refused():
    sitk = pytest.importorskip("SimpleITK")
    check_refused(sitk.Image((3, 5, 7), sitk.sitkVectorUInt8, 2), "2 numbers per voxel")
    check_refused(sitk.Image((3, 5), sitk.sitkUInt8), "need 3 axes")
    check_refused(sitk.Image((3, 5, 7), sitk.sitkComplexFloat32), error=TypeError)
    check_refused(sitk.Image(), "need 3 axes")


def test_itk():
    itk = pytest.importorskip("itk")
    direction = make_direction()
    image = itk.image_from_array(make_voxels())
    image.SetSpacing(SPACING[::-1])
    image.SetOrigin(ORIGIN[::-1])
    image.SetDirection(itk.matrix_from_array(direction))
    source = as_source(image)
    check_source(source, make_voxels(), spacing=SPACING, origin=ORIGIN, direction=direction)
    for z, y, x in ((0, 0, 0), (6, 4, 2), (1, 3, 2)):
        expected = image.TransformIndexToPhysicalPoint([x, y, z])
        np.testing.assert_allclose(world(source, z, y, x), list(expected), atol=60 * 10 * 2**-53)
    # A region that does not begin at index 0.
    crop = itk.ExtractImageFilter.New(image)
    region = itk.ImageRegion[3]()
    region.SetIndex([1, 2, 3])
    region.SetSize([2, 3, 4])
    crop.SetExtractionRegion(region)
    crop.Update()
    source = as_source(crop.GetOutput())
    np.testing.assert_array_equal(read_all(source), make_voxels()[3:7, 2:5, 1:3])
    expected = image.TransformIndexToPhysicalPoint([1, 2, 3])
    np.testing.assert_allclose(world(source, 0, 0, 0), list(expected), atol=60 * 10 * 2**-53)


def test_itk_that_is_refused():
    itk = pytest.importorskip("itk")
    check_refused(itk.image_from_array(np.zeros((5, 3), "u1")), "need 3 axes")
    vectors = itk.image_from_array(np.zeros((7, 5, 3, 2), "f4"), is_vector=True)
    check_refused(vectors, "2 numbers per voxel")


def make_pyvista(pyvista, voxels=None):
    voxels = make_voxels() if voxels is None else voxels
    grid = pyvista.ImageData(
        dimensions=voxels.shape[::-1], spacing=SPACING[::-1], origin=ORIGIN[::-1]
    )
    grid.point_data["ct"] = voxels.ravel()
    return grid


def test_pyvista():
    pyvista = pytest.importorskip("pyvista")
    grid = make_pyvista(pyvista)
    check_source(as_source(grid), make_voxels(), spacing=SPACING, origin=ORIGIN)
    grid.direction_matrix = make_direction()
    grid.offset = (4, -5, 6)
    source = as_source(grid)
    np.testing.assert_array_equal(source.direction, make_direction())
    points = grid.points.reshape(NZ, NY, NX, 3)
    for index in ((0, 0, 0), (6, 4, 2), (1, 3, 2)):
        # pyvista may give float32 points of positions below 100.
        np.testing.assert_allclose(world(source, *index), points[index], atol=100 * 10 * 2**-24)
    crop = make_pyvista(pyvista).extract_subset((1, 2, 1, 4, 2, 5), rebase_coordinates=False)
    source = as_source(crop)
    np.testing.assert_array_equal(read_all(source), make_voxels()[2:6, 1:5, 1:3])
    assert source.origin == (16.0, -19.5, 32.0)


@pytest.mark.parametrize("dtype", KEPT + ["bool"])
def test_pyvista_types(dtype):
    pyvista = pytest.importorskip("pyvista")
    source = as_source(make_pyvista(pyvista, make_voxels(dtype)))
    assert source.dtype == READ_AS.get(dtype, dtype)
    np.testing.assert_array_equal(read_all(source), make_voxels(dtype))


def test_vtk_alone():
    data_model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    image = data_model.vtkImageData()
    image.SetExtent(2, 4, 0, 4, -1, 5)
    vtk_signed_char, vtk_char = 15, 2
    for kind in (vtk_signed_char, vtk_char):
        image.AllocateScalars(kind, 1)
        for z in range(NZ):
            image.SetScalarComponentFromDouble(2, 0, z - 1, 0, -z)
        source = as_source(image)
        assert source.dtype == np.int8 and source.origin == (-1.0, 0.0, 2.0)
        np.testing.assert_array_equal(read_all(source)[:, 0, 0], -np.arange(NZ))
    image.AllocateScalars(vtk_char, 3)
    check_refused(image, "3 numbers per voxel")
    image.AllocateScalars(1, 1)
    check_refused(image, "single bits", error=TypeError)
    check_refused(data_model.vtkImageData(), "0 voxels along z")


def test_pyvista_that_is_refused():
    pyvista = pytest.importorskip("pyvista")
    grid = pyvista.ImageData(dimensions=(NX, NY, NZ))
    check_refused(grid, "no active scalars")
    grid.cell_data["ct"] = np.zeros(grid.n_cells)
    check_refused(grid, "belong to cells", "cell_data_to_point_data()")
    check_refused(pyvista.Sphere(), "only ImageData", error=TypeError)


# nibabel ----------------------------------------------------------------------------------------


def to_file(nibabel, image, path):
    nibabel.save(image, path)
    program = os.environ.get("ISOWAVE_PROGRAM")
    if not program:
        pytest.skip("ISOWAVE_PROGRAM does not say where the built program is")
    run = subprocess.run([program, "info", "--json", path], capture_output=True, text=True)
    if run.returncode:
        return None, run.stderr
    return json.loads(run.stdout), ""


def check_equals_file(nibabel, image, path):
    """The image in memory, the image of its file, and the program's reader agree."""
    unsaved = as_source(image)  # first, because saving changes the image's header
    info, error = to_file(nibabel, image, path)
    assert info is not None, error
    loaded = nibabel.load(path)
    for given, source in ((image, unsaved), (image, as_source(image)), (loaded, as_source(loaded))):
        assert list(source.shape[::-1]) == info["dims"]
        # The header has float32, of the affine and of the spacing: relative errors of 2^-24 each.
        # Its quaternion's parts are up to 1.
        np.testing.assert_allclose(source.spacing[::-1], info["spacing"], rtol=2**-22)
        np.testing.assert_allclose(source.origin[::-1], info["origin"], rtol=2**-22)
        np.testing.assert_allclose(source.direction.T, info["direction"], rtol=0, atol=2**-20)
        voxels = read_all(source, 4)
        assert [voxels.min(), voxels.max()] == info["value_range"]
        np.testing.assert_array_equal(voxels, np.asarray(given.dataobj).squeeze().T)
    assert str(as_source(loaded).dtype) == info["type"]


def make_affine(seed=0, shear=0.0):
    rng = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    affine = np.eye(4)
    affine[:3, :3] = rotation * [2.0, 0.5, 3.0]
    affine[0, 1] += shear
    affine[:3, 3] = rng.normal(size=3) * 100
    return affine


def nifti_images(nibabel):
    data = np.ascontiguousarray(make_voxels().T)
    yield "identity", nibabel.Nifti1Image(data, np.eye(4))
    yield "shear", nibabel.Nifti1Image(data, make_affine(shear=0.1))
    yield "trailing axes", nibabel.Nifti1Image(data[..., None, None], make_affine())
    yield "float", nibabel.Nifti1Image(data.astype("float32"), make_affine())
    for seed in range(4):
        yield f"rotated {seed}", nibabel.Nifti1Image(data, make_affine(seed))
        scanner = nibabel.Nifti1Image(data, make_affine(seed))
        scanner.set_qform(make_affine(seed), code=2)
        scanner.set_sform(make_affine(seed), code=1)
        yield f"scanner {seed}", scanner
        only = nibabel.Nifti1Image(data, make_affine(seed))
        only.set_qform(make_affine(seed), code=2)
        only.set_sform(None, code=0)
        yield f"only qform {seed}", only
        rewritten = nibabel.Nifti1Image(data, make_affine(seed))
        rewritten.affine[:3, 3] += 5
        yield f"changed affine {seed}", rewritten
    mirrored = make_affine() @ np.diag([1, 1, -1, 1])
    for name, affine in (("turned", make_affine()), ("mirrored", mirrored)):
        image = nibabel.Nifti1Image(data, affine)
        image.set_qform(affine, code=1)
        image.set_sform(None, code=0)
        yield name, image
    for unit in ("meter", "mm", "micron"):
        image = nibabel.Nifti1Image(data, make_affine())
        image.header.set_xyzt_units(unit, "sec")
        yield unit, image


def test_nibabel_equals_our_reader(tmp_path):
    nibabel = pytest.importorskip("nibabel")
    for number, (name, image) in enumerate(nifti_images(nibabel)):
        print(name)
        check_equals_file(nibabel, image, tmp_path / f"{number}.nii{'.gz' * (number % 2)}")


@pytest.mark.parametrize("dtype", ["int16", "float32", "uint8"])
def test_nibabel_scaled_file(tmp_path, dtype):
    nibabel = pytest.importorskip("nibabel")
    image = nibabel.Nifti1Image(np.ascontiguousarray(make_voxels(dtype).T), make_affine())
    image.header.set_slope_inter(2, -3)
    nibabel.save(image, tmp_path / "s.nii")
    loaded = nibabel.load(tmp_path / "s.nii")
    expected = np.asarray(loaded.dataobj).T
    assert not np.array_equal(expected, make_voxels(dtype))
    np.testing.assert_array_equal(read_all(as_source(loaded), 4), expected)
    program = os.environ.get("ISOWAVE_PROGRAM")
    if not program:
        pytest.skip("ISOWAVE_PROGRAM does not say where the built program is")
    run = [program, "info", "--json", tmp_path / "s.nii"]
    info = json.loads(subprocess.run(run, capture_output=True, check=True).stdout)
    assert str(as_source(loaded).dtype) == info["type"]


def nibabel_images_that_were_read(nibabel, tmp_path):
    """Whose headers are unlike those that nibabel writes."""
    data = np.ascontiguousarray(make_voxels("int16").T)
    other_qform = nibabel.Nifti1Image(data, make_affine(1))
    other_qform.set_qform(make_affine(2), code=1)
    other_qform.set_sform(make_affine(1), code=4)
    other_steps = nibabel.Nifti1Image(data, make_affine(1))
    other_steps.set_qform(None, code=0)
    other_steps.header.set_zooms((2.004, 0.5, 3))
    for image in (nibabel.Nifti1Image(data, None), other_qform, other_steps):
        nibabel.save(image, tmp_path / "a.nii")
        yield nibabel.load(tmp_path / "a.nii")


def test_nibabel_positions_are_those_of_its_affine(tmp_path):
    nibabel = pytest.importorskip("nibabel")
    images = list(nibabel_images_that_were_read(nibabel, tmp_path))
    for cls in (nibabel.Nifti1Image, nibabel.Nifti2Image, nibabel.MGHImage):
        for shear in (0, 2e-4, 0.3):
            data = np.ascontiguousarray(make_voxels("int16").T)
            images.append(cls(data, make_affine(3, shear)))
    for image in images:
        affine = image.affine
        source = as_source(image)
        np.testing.assert_array_equal(read_all(source), make_voxels("int16"))
        for z, y, x in ((0, 0, 0), (6, 4, 2), (1, 3, 2)):
            expected = (affine @ [x, y, z, 1])[:3] * [-1, -1, 1]
            # The header has float32: relative errors of 2^-24 in terms of at most 300.
            np.testing.assert_allclose(world(source, z, y, x), expected, atol=300 * 8 * 2**-24)


def test_nibabel_objects_lie_where_their_affine_says(tmp_path):
    """Whichever form that is of, sheared or not; a file's unit of lengths counts."""
    nibabel = pytest.importorskip("nibabel")
    data = np.ascontiguousarray(make_voxels().T)
    both = nibabel.Nifti1Image(data, make_affine(1))
    both.set_qform(make_affine(11), code=1)  # other spacings, too
    neither = nibabel.Nifti1Image(data, None)
    sheared = nibabel.Nifti1Image(data, make_affine(2, shear=0.1))
    in_memory = nibabel.Nifti1Image(data, make_affine(3))
    in_memory.affine[:3, 3] += 5
    for number, image in enumerate((both, neither, sheared, in_memory)):
        nibabel.save(image, tmp_path / f"{number}.nii")
        for given in (image, nibabel.load(tmp_path / f"{number}.nii")):
            source = as_source(given)
            for z, y, x in ((0, 0, 0), (6, 4, 2), (1, 3, 2)):
                expected = np.array([x, y, z, 1.0])
                if given.affine is not None:
                    expected = given.affine @ expected
                    expected *= [-1, -1, 1, 1]
                atol = 300 * 8 * 2**-24
                np.testing.assert_allclose(world(source, z, y, x), expected[:3], atol=atol)
    sheared.header.set_xyzt_units("micron", "sec")
    steps = np.linalg.norm(sheared.affine[:3, :3], axis=0)[::-1]
    np.testing.assert_allclose(as_source(sheared).spacing, steps * 1e-3)


def test_nibabel_that_is_refused():
    nibabel = pytest.importorskip("nibabel")
    series = nibabel.Nifti1Image(np.zeros((3, 5, 7, 4), "f4"), np.eye(4))
    check_refused(series, "image.slicer[..., 0]")
    check_refused(nibabel.Nifti1Image(np.zeros((3, 5), "f4"), np.eye(4)), "need 3 axes")
    check_refused(nibabel.Nifti1Image(np.zeros((3, 5, 7), "c8"), np.eye(4)), error=TypeError)
    flat = nibabel.MGHImage(np.zeros((3, 5, 7), "f4"), np.eye(4))
    flat._affine = np.diag([1.0, 0.0, 1.0, 1.0])
    check_refused(flat, "column of axis y has length 0")
    flat._affine = make_affine()
    flat._affine[:, 2] = flat._affine[:, 1]
    check_refused(flat, "singular")


def test_nibabel_reads_a_file_by_slabs(tmp_path, monkeypatch):
    nibabel = pytest.importorskip("nibabel")
    voxels = make_voxels("int16", (70, 5, 3))
    nibabel.save(nibabel.Nifti1Image(np.ascontiguousarray(voxels.T), np.eye(4)), tmp_path / "a.nii")
    loaded = nibabel.load(tmp_path / "a.nii")
    monkeypatch.setattr(
        nibabel.arrayproxy.ArrayProxy, "__array__", lambda *_: pytest.fail("read as a whole")
    )
    check_source(as_source(loaded), voxels, direction=np.diag([-1.0, -1.0, 1.0]))


# Imports and memory -----------------------------------------------------------------------------

PACKAGES = (
    "xarray dask zarr h5py tensorstore SimpleITK itk nibabel pyvista vtk torch cupy pandas scipy"
).split()


def run_python(code):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-c", code]
    run = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert run.returncode == 0, run.stderr
    return run.stdout


def test_nothing_is_imported():
    code = f"""
import sys, numpy
from isowave._arrays import as_source
as_source(numpy.zeros((7, 5, 3))).read(0, 7)
try:
    as_source(object())
except TypeError:
    pass
print([name for name in {PACKAGES} if name in sys.modules])
"""
    assert run_python(code).strip() == "[]"


@pytest.mark.parametrize(
    "package, make",
    [
        ("xarray", "xarray.DataArray(voxels)"),
        ("zarr", "zarr.array(voxels)"),
        ("h5py", "make_h5py()"),
        ("tensorstore", "tensorstore.array(voxels)"),
        ("SimpleITK", "SimpleITK.GetImageFromArray(voxels)"),
        ("nibabel", "nibabel.Nifti1Image(voxels, numpy.eye(4))"),
        ("vtkmodules.vtkCommonDataModel", "make_vtk()"),
    ],
)
def test_no_other_package_is_imported(package, make):
    pytest.importorskip(package)
    code = f"""
import sys, numpy, {package}
from isowave._arrays import as_source
def make_vtk():
    image = vtkmodules.vtkCommonDataModel.vtkImageData()
    image.SetDimensions(3, 5, 7)
    image.AllocateScalars(4, 1)
    return image
def make_h5py():
    file = h5py.File('a', 'w', driver='core', backing_store=False)
    return file.create_dataset('a', data=voxels)
def packages():
    return {{name.partition('.')[0] for name in sys.modules}}
voxels = numpy.zeros((7, 5, 3), 'int16')
made = {make}
before = packages()
source = as_source(made)
source.read(0, source.shape[0])
print(sorted((packages() - before) & set({PACKAGES + ['vtkmodules']})))
"""
    assert run_python(code).strip() == "[]"


def test_zarr_larger_than_what_is_held(tmp_path):
    """256 MiB by slabs: the process, with zarr itself, stays below 256 MiB."""
    zarr = pytest.importorskip("zarr", minversion="3")
    made = zarr.create_array(tmp_path / "a", shape=(512, 512, 256), chunks=(64,) * 3, dtype="f4")
    row = np.random.default_rng(0).normal(size=(64, 512, 256)).astype("float32")
    for z in range(0, 512, 64):
        made[z : z + 64] = row
    code = f"""
import zarr
from isowave._arrays import as_source
source = as_source(zarr.open_array({str(tmp_path / "a")!r}, mode="r"))
for z in range(0, 512, 32):
    source.read(z, z + 32)
# Not getrusage(), whose peak is at least that of the process that started this one.
print([line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")][0])
"""
    peak = int(run_python(code)) / 1024
    print(f"peak {peak:.0f} MiB")
    assert peak < 256
