"""Malformed metadata of every package: as_source() gives a sound source or one line, nothing else.

Each test makes ISOWAVE_FUZZ_INPUTS inputs (default 10,000; the long run takes 100,000) from a fixed
seed. Most are objects that look like a package's, which can hold what the package would refuse;
one in 20 is a real one, where the package is installed.
"""

import math
import sys
import types

import numpy as np
import pytest
from array_fuzzer import SIZES, Fake, fake, run_fuzz, some_real


# Warnings of packages while the inputs are made: casts that overflow, masked elements.
pytestmark = pytest.mark.filterwarnings("ignore")


# What the caller says, numpy, buffers and protocols ---------------------------------------------

VOXELS = np.zeros((7, 5, 3), "u2")


def test_options():
    def make(fuzzer):
        options = {}
        if fuzzer.one_in(2):
            options["spacing"] = fuzzer.maybe(fuzzer.steps(), 3)
        if fuzzer.one_in(2):
            options["origin"] = fuzzer.numbers(3)
        if fuzzer.one_in(2):
            options["direction"] = fuzzer.direction()
        if fuzzer.one_in(4):
            options["fill_value"] = fuzzer.maybe(3, 2)
        return VOXELS, options

    run_fuzz(make, seed=1)


def test_numpy():
    def make(fuzzer):
        shape = fuzzer.shape()
        try:
            strides = None if fuzzer.one_in(2) else (0,) * len(shape)
            array = np.ndarray(shape, fuzzer.dtype(), bytes(1 << 12), 0, strides)
        except Exception:
            return None
        if fuzzer.one_in(4) and array.size < 1000:
            array = np.ma.array(array, mask=fuzzer.one_in(2))
        return array, {"fill_value": fuzzer.wild()} if fuzzer.one_in(4) else {}

    run_fuzz(make, seed=2)


def test_protocols():
    def make_object(fuzzer):
        kind = fuzzer.rng.randrange(6)
        answer = fuzzer.maybe(VOXELS, 2)
        if kind == 0:
            return fake("torch", "Tensor", __array__=lambda self, *a, **k: answer)()
        if kind == 1:
            device = fuzzer.maybe((fuzzer.rng.randrange(-1, 16), 0), 2)
            methods = {
                "__dlpack__": lambda self, **k: VOXELS.__dlpack__(**k),
                "__dlpack_device__": lambda self: device,
            }
            return fake("jax", "Array", **methods)()
        if kind == 2:
            return memoryview(bytes(210)).cast("B").cast("H", (7, 5, 3))
        if kind == 3:
            return [answer]
        if kind == 4:
            return fake("cupy", "ndarray", __cuda_array_interface__=fuzzer.wild())()
        return fuzzer.wild()

    # In a pair, since some of them are tuples themselves.
    run_fuzz(lambda fuzzer: (make_object(fuzzer), {}), seed=3)


# Stores -----------------------------------------------------------------------------------------


class FakeDask(fake("dask.array.core", "Array")):
    __qualname__ = "Array"

    def __getitem__(self, index):
        return types.SimpleNamespace(compute=lambda: super(FakeDask, self).__getitem__(index))


FakeDask.__name__ = "Array"


FakeDask.__module__ = "dask.array.core"


def test_dask():
    da = pytest.importorskip("dask.array")

    def make_fake(fuzzer):
        layers = fuzzer.maybe(fuzzer.rng.choice([(7,), (3, 4), (0, 7), (2, 2, 3), (3, 3)]))
        chunks = fuzzer.maybe((layers, (5,), (3,)))
        return FakeDask(shape=fuzzer.shape(), dtype=fuzzer.dtype(), chunks=chunks)

    def make_real(fuzzer):
        # Small, because dask lists every chunk.
        shape = [fuzzer.rng.choice(SIZES) for _ in range(fuzzer.rng.choice([3, 3, 3, 2, 4]))]
        try:
            return da.zeros(shape, fuzzer.dtype(), chunks=fuzzer.rng.randrange(2, 8))
        except Exception:
            return None

    run_fuzz(lambda fuzzer: some_real(fuzzer, make_fake, make_real), seed=4)


FakeZarr = fake("zarr.core.array", "Array")


def test_zarr():
    def make(fuzzer):
        chunks = fuzzer.maybe((fuzzer.rng.randrange(-1, 12), 2, 3))
        name = fuzzer.wild() if fuzzer.one_in(5) else "/ct"
        return FakeZarr(shape=fuzzer.shape(), dtype=fuzzer.dtype(), chunks=chunks, name=name)

    run_fuzz(make, seed=5)


OME = {
    "version": "0.5",
    "multiscales": [
        {
            "axes": [
                {"name": "t", "type": "time"},
                {"name": "c", "type": "channel"},
                {"name": "z", "type": "space", "unit": "micrometer"},
                {"name": "y", "type": "space"},
                {"name": "x", "type": "space"},
            ],
            "datasets": [
                {
                    "path": "0",
                    "coordinateTransformations": [
                        {"type": "scale", "scale": [1.0, 1.0, 3.0, 0.5, 2.0]},
                        {"type": "translation", "translation": [0.0, 0.0, 1.0, 2.0, 3.0]},
                    ],
                }
            ],
            "coordinateTransformations": [{"type": "scale", "scale": [1.0] * 5}],
        }
    ],
}


def test_ome_zarr():
    try:
        import zarr

        real = zarr.create_group({})
        real.create_array("0", shape=(1, 1, 7, 5, 3), chunks=(1, 1, 4, 5, 3), dtype="u2")
    except (ImportError, AttributeError):  # zarr 2
        real = None

    def make_real(fuzzer):
        if real is None or not fuzzer.one_in(10):
            return None  # a group takes a while to write its metadata
        try:
            real.attrs.put({"ome": fuzzer.deep(OME)})
        except Exception:
            return None
        return real

    def make_fake(fuzzer):
        metadata = fuzzer.deep(OME)
        shape = fuzzer.maybe((1, 1, 7, 5, 3)) if not fuzzer.one_in(8) else (1, 2, 7, 5, 3)
        array = FakeZarr(shape=shape, dtype=fuzzer.dtype(), chunks=fuzzer.maybe((1, 1, 4, 5, 3)))
        attrs = {"ome": metadata} if fuzzer.one_in(2) else fuzzer.maybe(metadata)
        return FakeGroup(attrs=attrs, arrays={"0": array})

    class FakeGroup(fake("zarr.core.group", "Group")):
        def __getitem__(self, path):
            return self.arrays[path]

    FakeGroup.__name__, FakeGroup.__module__ = "Group", "zarr.core.group"
    run_fuzz(lambda fuzzer: some_real(fuzzer, make_fake, make_real), seed=6)


def test_h5py():
    class FakeDataset(fake("h5py._hl.dataset", "Dataset")):
        def __bool__(self):
            return self.is_open

    FakeDataset.__name__, FakeDataset.__module__ = "Dataset", "h5py._hl.dataset"

    def make(fuzzer):
        space = types.SimpleNamespace
        chunks = fuzzer.maybe(fuzzer.rng.choice([None, (3, 2, 2), (100, 1, 1)]))
        attributes = {name: fuzzer.wild() for name in ("missing_value", "_FillValue")}
        created = space(fill_value_defined=lambda: fuzzer.rng.randrange(3))
        return FakeDataset(
            attrs=fuzzer.maybe(attributes if fuzzer.one_in(4) else {}),
            file=space(attrs={"_NCProperties": "version=2"} if fuzzer.one_in(4) else {}),
            id=space(get_create_plist=lambda: created),
            fillvalue=fuzzer.maybe(np.float32(-9), 4),
            shape=fuzzer.shape(),
            dtype=fuzzer.dtype(),
            chunks=chunks,
            is_open=not fuzzer.one_in(30),
            name=fuzzer.maybe("/ct"),
        )

    run_fuzz(make, seed=7)


def test_tensorstore():
    class FakeStore(fake("tensorstore", "TensorStore")):
        def __getitem__(self, index):
            future = types.SimpleNamespace(result=lambda: np.zeros((2, 5, 3), "u2"))
            return types.SimpleNamespace(read=lambda: future)

    FakeStore.__name__, FakeStore.__module__ = "TensorStore", "tensorstore"

    def make(fuzzer):
        space = types.SimpleNamespace
        origin = (fuzzer.rng.randrange(-9, 9), 0, 0)
        chunk = fuzzer.maybe(
            fuzzer.rng.choice([(4, 2, 2), (None,) * 3, (1, 1, 1), None, (9, 9, 9)])
        )
        return FakeStore(
            fill_value=fuzzer.maybe(np.array(-9, "i2"), 4),
            shape=fuzzer.shape(),
            dtype=space(numpy_dtype=fuzzer.dtype()),
            domain=space(origin=fuzzer.maybe(origin)),
            chunk_layout=space(read_chunk=space(shape=chunk), grid_origin=fuzzer.maybe(origin)),
        )

    run_fuzz(make, seed=8)


# xarray -----------------------------------------------------------------------------------------


def make_coordinate(fuzzer, count):
    kind = fuzzer.rng.randrange(8)
    start, step = fuzzer.number(), fuzzer.number()
    values = start + step * np.arange(count, dtype=float)
    if kind == 0:
        values = values + np.array([fuzzer.rng.uniform(-1, 1) for _ in range(count)])
    elif kind == 1:
        values[fuzzer.rng.randrange(count)] = fuzzer.rng.choice([np.nan, np.inf, 1e308, -1e308])
    elif kind == 2:
        values = np.array([str(value) for value in values])
    elif kind == 3:
        values = np.datetime64("2020-01-01", "ns") + np.arange(count) * np.timedelta64(1, "D")
    elif kind == 4:
        values = values.astype(fuzzer.rng.choice(["f4", "i2", "f2", "c8", "b1", "O"]))
    elif kind == 5:
        values = fuzzer.maybe(values, 2)
    return values


def test_xarray():
    xarray = pytest.importorskip("xarray")

    class FakeArray(fake("xarray.core.dataarray", "DataArray")):
        pass

    FakeArray.__name__, FakeArray.__module__ = "DataArray", "xarray.core.dataarray"

    def make_fake(fuzzer):
        shape = fuzzer.shape()
        dims = fuzzer.maybe(("z", "y", "x"), 30)
        coords = {
            dim: types.SimpleNamespace(values=make_coordinate(fuzzer, count))
            for dim, count in (("z", 7), ("y", 5), ("x", 3))
            if fuzzer.one_in(4)
        }
        encoding = {"preferred_chunks": fuzzer.maybe({"z": fuzzer.maybe(3, 3), "y": 2}, 4)}
        variable = types.SimpleNamespace(
            isel=lambda index: types.SimpleNamespace(values=np.zeros((2, 5, 3), "u2"))
        )
        made = FakeArray(
            shape=shape,
            dtype=fuzzer.dtype(),
            dims=dims,
            sizes=dict(zip("zyx", (7, 5, 3))),
            coords=coords,
            chunks=fuzzer.maybe(fuzzer.rng.choice([None, None, ((3, 4), (5,), (3,))])),
            encoding=fuzzer.maybe(encoding),
            variable=variable,
            name=fuzzer.maybe("ct"),
        )
        return made, {"spacing": fuzzer.steps()} if fuzzer.one_in(4) else {}

    def make_real(fuzzer):
        try:
            coords = {
                dim: make_coordinate(fuzzer, count)
                for dim, count in (("z", 7), ("y", 5), ("x", 3))
                if fuzzer.one_in(4)
            }
            return xarray.DataArray(VOXELS, coords, dims=("z", "y", "x"))
        except Exception:
            return None

    run_fuzz(lambda fuzzer: some_real(fuzzer, make_fake, make_real), seed=9)


# Images -----------------------------------------------------------------------------------------


def test_simpleitk(monkeypatch):
    try:
        import SimpleITK as sitk
    except ImportError:
        sitk = None
    FakeImage = fake("SimpleITK.SimpleITK", "Image")

    def view(image):
        return image.view if isinstance(image, Fake) else sitk.GetArrayViewFromImage(image)

    monkeypatch.setitem(sys.modules, "SimpleITK", types.SimpleNamespace(GetArrayViewFromImage=view))

    def make_fake(fuzzer):
        size = fuzzer.maybe((3, 5, 7), 30)
        components = fuzzer.maybe(1, 40)
        rows = [value for row in np.eye(3).tolist() for value in row]
        direction = fuzzer.direction()
        if isinstance(direction, list) and all(isinstance(row, list) for row in direction):
            rows = [value for row in direction for value in row]
        rows, spacing, origin = (
            fuzzer.maybe(rows),
            fuzzer.maybe(fuzzer.steps(), 4),
            fuzzer.numbers(3),
        )
        return FakeImage(
            GetNumberOfComponentsPerPixel=lambda: components,
            GetSize=lambda: size,
            GetDirection=lambda: rows,
            GetSpacing=lambda: spacing,
            GetOrigin=lambda: origin,
            view=fuzzer.maybe(VOXELS, 40),
        )

    def make_real(fuzzer):
        if sitk is None:
            return None
        image = sitk.Image([fuzzer.rng.choice(SIZES[:-1]) for _ in range(3)], sitk.sitkInt16)
        try:
            spacing = np.array(fuzzer.maybe(fuzzer.steps(), 2), dtype=float)
            direction = np.array(fuzzer.direction(), dtype=float)
            if not (abs(spacing) < 1e6).all() or not (abs(direction) < 1e6).all():
                return None  # ITK inverts their product, which may never end beyond float64
            image.SetSpacing(spacing)
            image.SetOrigin([fuzzer.rng.choice((1.0, math.nan, math.inf)), 2.0, 3.0])
            image.SetDirection(direction.ravel())
        except Exception:
            return None
        return image

    run_fuzz(lambda fuzzer: some_real(fuzzer, make_fake, make_real), seed=10)


def test_itk(monkeypatch):
    view = types.SimpleNamespace(array_view_from_image=lambda image: image.view)
    monkeypatch.setitem(sys.modules, "itk", view)
    FakeImage = fake("itk.itkImagePython", "itkImageBase3")

    def make(fuzzer):
        size, index = fuzzer.maybe((3, 5, 7), 30), fuzzer.maybe((1, -2, 3))
        region = types.SimpleNamespace(GetSize=lambda: size, GetIndex=lambda: index)
        direction, origin = fuzzer.direction(), fuzzer.numbers(3)
        spacing = fuzzer.maybe(fuzzer.steps(), 4)
        return FakeImage(
            GetNumberOfComponentsPerPixel=lambda: 1,
            GetBufferedRegion=lambda: region,
            GetDirection=lambda: direction,
            GetSpacing=lambda: spacing,
            GetOrigin=lambda: origin,
            view=fuzzer.maybe(VOXELS, 40),
        )

    run_fuzz(make, seed=11)


def test_vtk():
    FakeImage = fake("vtkmodules.vtkCommonDataModel", "vtkImageData")
    try:
        from vtkmodules.vtkCommonDataModel import vtkImageData
    except ImportError:
        vtkImageData = None

    # VTK crashes by itself if it is asked for others, as voxels of text.
    numeric_kinds = [kind for kind in range(1, 18) if kind not in (13, 14)]

    class Scalars(np.ndarray):
        kind, num_components = 5, 1

        def GetDataType(self):
            return self.kind

        def GetNumberOfComponents(self):
            return self.num_components

    flat = VOXELS.ravel().view(Scalars)

    def make_fake(fuzzer):
        dimensions = fuzzer.maybe((3, 5, 7), 30)
        scalars = fuzzer.maybe(flat, 40)
        direction = fuzzer.direction()
        origin, spacing = fuzzer.numbers(3), fuzzer.maybe(fuzzer.steps(), 4)
        extent = fuzzer.maybe((0, 2, -1, 3, 5, 11))
        matrix = types.SimpleNamespace(GetElement=lambda i, j: direction[i][j])
        points = types.SimpleNamespace(GetScalars=lambda: scalars)
        cells = types.SimpleNamespace(GetScalars=lambda: None)
        return FakeImage(
            GetDimensions=lambda: dimensions,
            GetPointData=lambda: points,
            GetCellData=lambda: cells,
            GetDirectionMatrix=lambda: matrix,
            GetSpacing=lambda: spacing,
            GetOrigin=lambda: origin,
            GetExtent=lambda: extent,
        )

    def make_real(fuzzer):
        if vtkImageData is None:
            return None
        image = vtkImageData()
        try:
            image.SetDimensions(*(fuzzer.maybe(size, 20) for size in (3, 5, 7)))
            image.SetSpacing(*fuzzer.maybe(fuzzer.steps(), 3))
            image.SetOrigin(*fuzzer.numbers(3))
            image.SetDirectionMatrix([value for row in fuzzer.direction() for value in row])
            if not 0 < image.GetNumberOfPoints() < 10000:
                return None
            image.AllocateScalars(fuzzer.rng.choice(numeric_kinds), fuzzer.rng.choice([1, 1, 1, 2]))
        except Exception:
            return None
        return image

    run_fuzz(lambda fuzzer: some_real(fuzzer, make_fake, make_real), seed=12)


def make_affine(fuzzer):
    affine = np.eye(4)
    rows = fuzzer.direction()
    try:
        affine[:3, :3] = np.array(rows, dtype=float) * fuzzer.steps()
    except Exception:
        return rows
    affine[:3, 3] = [fuzzer.number() for _ in range(3)]
    if fuzzer.one_in(6):
        choice = [np.nan, np.inf, 0.0, 1e300, 1e-320]
        affine[fuzzer.rng.randrange(4), fuzzer.rng.randrange(4)] = fuzzer.rng.choice(choice)
    return affine


def test_nibabel():
    try:
        import nibabel
    except ImportError:
        nibabel = None
    FakeImage = fake("nibabel.spatialimages", "DataobjImage")
    data = np.ascontiguousarray(VOXELS.T)
    names = "quatern_b quatern_c quatern_d qoffset_x qoffset_y qoffset_z".split()

    class Header(dict):
        def get_best_affine(self):
            return self.affine

        def copy(self):
            return self

        def set_sform(self, affine, code):
            pass

        set_qform = set_sform

    def make_header(fuzzer, affine):
        spacing = np.linalg.norm(affine[:3, :3], axis=0)
        header = Header(
            pixdim=[fuzzer.rng.choice([-1.0, 1.0]), *spacing.tolist(), 0, 0, 0, 0],
            qform_code=fuzzer.rng.randrange(-1, 7) if fuzzer.one_in(4) else 0,
            sform_code=fuzzer.rng.randrange(-1, 7) if fuzzer.one_in(4) else 1,
            xyzt_units=fuzzer.rng.choice([0, 1, 2, 3, 10, 2, 7, 2]),
            intent_code=1004 if fuzzer.one_in(40) else 0,
            srow_x=affine[0],
            srow_y=affine[1],
            srow_z=affine[2],
        )
        header.update((name, fuzzer.rng.uniform(-0.7, 0.7)) for name in names)
        if fuzzer.one_in(3):
            header[fuzzer.rng.choice(list(header))] = fuzzer.wild()
        if fuzzer.one_in(10):
            del header[fuzzer.rng.choice(list(header))]
        header.affine = affine
        return header

    def make_fake(fuzzer):
        affine = make_affine(fuzzer)
        shape = fuzzer.maybe((3, 5, 7) if not fuzzer.one_in(9) else (3, 5, 7, 2), 30)
        header = {}
        if isinstance(affine, np.ndarray) and affine.shape == (4, 4) and not fuzzer.one_in(3):
            with np.errstate(all="ignore"):
                header = make_header(fuzzer, affine)
        return FakeImage(
            shape=shape,
            dataobj=fuzzer.maybe(data, 40),
            affine=fuzzer.maybe(affine, 30),
            header=header,
        )

    def make_real(fuzzer):
        if nibabel is None:
            return None
        try:
            image = nibabel.Nifti1Image(data, make_affine(fuzzer))
            for name in ("pixdim", "srow_x", "srow_z"):
                if fuzzer.one_in(4):
                    place = fuzzer.rng.randrange(4)
                    image.header[name][place] = fuzzer.rng.choice([np.nan, -1.0, 0.0, np.inf, 1e30])
            for name in names:
                image.header[name] = fuzzer.rng.uniform(-0.6, 0.6)
            for name in ("qform_code", "sform_code"):
                image.header[name] = fuzzer.rng.randrange(-1, 7)
            image.header["xyzt_units"] = fuzzer.rng.randrange(256)
            return image
        except Exception:
            return None

    run_fuzz(lambda fuzzer: some_real(fuzzer, make_fake, make_real), seed=13)
