"""Arrays in chunks through as_source(), of stores and of dask: what is fetched, and how often."""

import numpy as np
import pytest
from array_checks import (
    NX,
    NY,
    NZ,
    ORIGIN,
    SLABS,
    SPACING,
    CountingChunks,
    check_refused,
    check_source,
    make_voxels,
    read_all,
    zarr_counting_store,
)

from isowave._arrays import as_source


# Chunks -----------------------------------------------------------------------------------------


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
