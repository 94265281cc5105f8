"""Images of packages that know where voxels lie, through as_source(): xarray, SimpleITK, itk, VTK,
and nibabel.

ISOWAVE_PROGRAM is the built program, whose NIfTI reader nibabel's must equal.
"""

import itertools
import json
import os
import subprocess

import numpy as np
import pytest
from array_checks import (
    KEPT,
    NX,
    NY,
    NZ,
    ORIGIN,
    READ_AS,
    SLABS,
    SPACING,
    check_refused,
    check_source,
    make_direction,
    make_voxels,
    read_all,
    world,
    zarr_counting_store,
)

from isowave._arrays import as_source


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
