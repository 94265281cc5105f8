"""Arrays through as_source(): voxels, grids, errors; what is imported for them.

Packages that are not installed are skipped. Sides and spacings are unequal everywhere, so that
swapped axes fail. test_array_chunks.py and test_array_images.py have the same for other packages.
"""

import array as array_module
import os
import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest
from array_checks import (
    KEPT,
    NX,
    NY,
    NZ,
    ORIGIN,
    READ_AS,
    SPACING,
    check_refused,
    check_source,
    make_direction,
    make_voxels,
    read_all,
    world,
)

from isowave._arrays import as_source


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
