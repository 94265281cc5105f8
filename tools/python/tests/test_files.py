"""Files that packages of Python read, each written by its own library: open(), errors, layers."""

import sys

import file_writers as write
import numpy as np
import pytest
from array_checks import SPACING, check_source, read_all
from file_writers import FORMATS, STEPS, VOXELS

import isowave
from isowave._arrays.grid import Placement
from isowave._files import is_read_by_packages, parse_index, source_of_file, steps_of_file
from isowave._files.contents import named_axes, of_array, pick


def source(path, dataset=None, index=None, spacing=None):
    return source_of_file(str(path), dataset, index, spacing)


@pytest.mark.parametrize("name, writer, dataset, spacing, origin", FORMATS)
def test_formats(tmp_path, name, writer, dataset, spacing, origin):
    path = tmp_path / name
    writer(path)
    assert is_read_by_packages(str(path))
    voxels = VOXELS.astype("uint16") if name == "ij.tiff" else VOXELS
    found = source(path, dataset)
    assert str(found.dtype) == str(voxels.dtype)
    check_source(found, voxels, spacing=pytest.approx(spacing), origin=pytest.approx(origin))
    volume = isowave.open(path, dataset=dataset)
    assert np.array_equal(volume[...], voxels.astype("float32"))
    assert volume.spacing == pytest.approx(spacing) and volume.origin == pytest.approx(origin)
    assert volume.source_dtype == voxels.dtype


def test_options_of_open(tmp_path):
    write.tiff(tmp_path / "a.tif")
    volume = isowave.open(tmp_path / "a.tif", spacing=(7, 8, 9), rate=8)
    assert volume.spacing == (7, 8, 9) and volume.bits_per_voxel == 8
    no_data = isowave.open(tmp_path / "a.tif", no_data=VOXELS[2, 1, 0])[...]
    assert np.array_equal(np.isnan(no_data), VOXELS == VOXELS[2, 1, 0])
    with pytest.raises(isowave.Error, match="shape and dtype are for raw files"):
        isowave.open(tmp_path / "a.tif", shape=(1, 2, 3))


@pytest.mark.parametrize("axes", ["TZYX", "CZYX"])
def test_further_axes_of_tiff(tmp_path, axes):
    path = tmp_path / "a.ome.tif"
    write.ome_tiff(path, STEPS, axes)
    further = axes[0].lower()
    check_source(source(path, index=f"{further}=2"), STEPS[2], spacing=SPACING)
    check_source(source(path, index={further: 0}), STEPS[0], spacing=SPACING)
    assert steps_of_file(str(path), None, None) == (("t", 3) if further == "t" else None)
    with pytest.raises(isowave.Error, match=f"axis {further} has 3 entries: choose one by index"):
        isowave.open(path)
    with pytest.raises(isowave.Error, match=f"{further}=3: axis {further} has 3 entries"):
        isowave.open(path, index=f"{further}=3")
    with pytest.raises(isowave.Error, match=rf"further axes are {further} \(3 entries\)"):
        isowave.open(path, index="q=0")


def test_axes_of_tiff_in_any_order(tmp_path):
    """Channels behind z, and colours behind x."""
    write.ome_tiff(tmp_path / "a.ome.tif", STEPS.transpose(1, 0, 2, 3), "ZCYX")
    check_source(source(tmp_path / "a.ome.tif", index="c=1"), STEPS[1], spacing=SPACING)
    colours = np.stack([VOXELS, VOXELS + 1, VOXELS + 2], -1).astype("uint8")
    write.tiff(tmp_path / "b.tif", colours, photometric="rgb")
    check_source(source(tmp_path / "b.tif", index="s=1"), colours[..., 1])
    (tmp_path / "c").mkdir()
    for i, layer in enumerate(colours):
        write.tiff(tmp_path / "c" / f"{i}.tif", layer, photometric="rgb")
    check_source(source(tmp_path / "c", index="s=2"), colours[..., 2])


def test_pictures_are_no_volumes(tmp_path):
    write.tiff(tmp_path / "a.tif", VOXELS.astype("uint8"), photometric="rgb")
    with pytest.raises(isowave.Error, match=r"shape \(7, 5, 3\), axes y, x, s: need z, y and x"):
        isowave.open(tmp_path / "a.tif")


def test_images_and_units_of_ome_tiff(tmp_path):
    tifffile = pytest.importorskip("tifffile")

    path = tmp_path / "a.ome.tif"
    nanometres = {"PhysicalSizeZ": 3000.0, "PhysicalSizeZUnit": "nm"}
    write.ome_tiff(path, **nanometres)  # x and y are in micrometres
    check_source(source(path), VOXELS, spacing=pytest.approx(SPACING))
    write.ome_tiff(path, PhysicalSizeZUnit="reference frame")
    with pytest.raises(isowave.Error, match="unknown unit of length 'reference frame'"):
        isowave.open(path)
    with tifffile.TiffWriter(path, ome=True) as file:
        for i in range(2):
            size = {"axes": "ZYX", "PhysicalSizeZ": i + 5.0}
            file.write(STEPS[i], photometric="minisblack", metadata=size)
    with pytest.raises(isowave.Error, match="2 images: choose one by dataset: 0, 1"):
        isowave.open(path)
    check_source(source(path, "1"), STEPS[1], spacing=(6.0, 1.0, 1.0))


@pytest.mark.parametrize(
    "name, writer, axis",
    [
        ("a.npy", lambda path: np.save(path, STEPS), "t"),
        ("a.nc", lambda path: write.netcdf(path, ("time", "z", "y", "x"), STEPS), "time"),
        ("a.zarr", lambda path: write.ome_zarr(path, STEPS, ("c",)), "c"),
        ("a.nii", lambda path: write.nifti2(path, STEPS), "t"),
        ("a.mrc", lambda path: write.mrc(path, STEPS), "t"),
    ],
)
def test_further_axes(tmp_path, name, writer, axis):
    writer(tmp_path / name)
    found = source(tmp_path / name, index=f"{axis[0]}=2")
    np.testing.assert_array_equal(read_all(found), STEPS[2])
    assert found.spacing == ((1, 1, 1) if name == "a.npy" else pytest.approx(SPACING))
    with pytest.raises(isowave.Error, match=f"axis {axis} has 3 entries: choose one by index"):
        isowave.open(tmp_path / name)
    if axis != "c":
        series = isowave.open_series(tmp_path / name)
        assert [np.array_equal(v[...], s) for v, s in zip(series, STEPS, strict=True)] == [True] * 3


def test_levels_of_ome_zarr(tmp_path):
    write.ome_zarr(tmp_path / "a.zarr")
    coarse = {"spacing": tuple(2 * s for s in SPACING), "origin": write.ORIGIN}
    check_source(source(tmp_path / "a.zarr", "1"), VOXELS[::2, ::2, ::2], **coarse)
    check_source(source(tmp_path / "a.zarr" / "1"), VOXELS[::2, ::2, ::2], **coarse)
    with pytest.raises(isowave.Error, match="dataset '2': the file has 0, 1"):
        isowave.open(tmp_path / "a.zarr", dataset="2")


def test_datasets_are_chosen_by_name(tmp_path):
    h5py = pytest.importorskip("h5py")

    np.savez(tmp_path / "a.npz", one=VOXELS, two=VOXELS + 1, flat=np.zeros((2, 2)))
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["s/one"], file["s/two"], file["flat"] = VOXELS, VOXELS + 1, np.zeros((2, 2))
    for name, two in (("a.npz", "two"), ("a.h5", "s/two")):
        assert np.array_equal(isowave.open(tmp_path / name, dataset=two)[...], VOXELS + 1)
        one = two.replace("two", "one")
        with pytest.raises(isowave.Error, match=f"2 [a-z]+: choose one by dataset: {one}, {two}"):
            isowave.open(tmp_path / name)
        with pytest.raises(isowave.Error, match="dataset 'three': the file has"):
            isowave.open(tmp_path / name, dataset="three")
        with pytest.raises(isowave.Error, match="flat: shape"):
            isowave.open(tmp_path / name, dataset="flat")
    np.savez(tmp_path / "b.npz", flat=np.zeros((2, 2)))
    with pytest.raises(isowave.Error, match="no array of 3 axes or more: the file has flat"):
        isowave.open(tmp_path / "b.npz")


def test_voxels_without_data_are_those_of_the_file(tmp_path):
    h5py = pytest.importorskip("h5py")

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["ct"] = VOXELS
        file["ct"].attrs["_FillValue"] = VOXELS[1, 2, 1]
    assert source(tmp_path / "a.h5").no_data == VOXELS[1, 2, 1]
    volume = isowave.open(tmp_path / "a.h5")
    assert np.array_equal(np.isnan(volume[...]), VOXELS == VOXELS[1, 2, 1])


def test_coordinates_that_are_not_even_need_a_spacing(tmp_path):
    netCDF4 = pytest.importorskip("netCDF4")

    write.netcdf(tmp_path / "a.nc")
    with netCDF4.Dataset(tmp_path / "a.nc", "a") as file:
        file["z"][3] += 1
    with pytest.raises(isowave.Error, match="'z' is not evenly spaced: pass spacing="):
        isowave.open(tmp_path / "a.nc")
    assert source(tmp_path / "a.nc", spacing=(9, 8, 7)).spacing == (9, 8, 7)


def test_layers_are_read_when_they_are_needed(tmp_path):
    """The last layer cannot be read; the first ones are read all the same."""
    write.tiff(tmp_path / "a.tif", VOXELS, compression="zlib")
    write.tiff_folder(tmp_path / "layers")
    write.vti(tmp_path / "a.vti")
    tifffile = pytest.importorskip("tifffile")

    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        at = file.pages[-1].dataoffsets[0]
    for path, begin in ((tmp_path / "a.tif", at), (tmp_path / "layers" / "layer_13.tif", 0)):
        damaged = bytearray(path.read_bytes())
        damaged[begin : begin + 8] = b"damaged!"
        path.write_bytes(damaged)
    for name in ("a.tif", "layers"):
        found = source(tmp_path / name)
        np.testing.assert_array_equal(found.read(0, 6), VOXELS[:6])
        with pytest.raises(ValueError, match="layers 6 to 7 cannot be read"):
            found.read(6, 7)
        with pytest.raises(isowave.Error, match=f"{name}: .*layers . to 7 cannot be read") as error:
            isowave.open(tmp_path / name)
        assert "\n" not in str(error.value)


def test_vti_is_read_by_layers(tmp_path, monkeypatch):
    from isowave._files import vtk_file

    loaded = []
    inner = vtk_file._contents

    def noting(load, *rest):
        return inner(lambda extent: loaded.append(extent) or load(extent), *rest)

    monkeypatch.setattr(vtk_file, "_contents", noting)
    for name, writer, points in (("a.vti", write.vti, 0), ("cells.vti", write.vti_of_cells, 1)):
        writer(tmp_path / name)
        found = source(tmp_path / name)
        loaded.clear()
        np.testing.assert_array_equal(found.read(3, 5), VOXELS[3:5])
        assert [extent[4:] for extent in loaded] == [(7, 8 + points)]


@pytest.mark.parametrize("name", [name for name, *_ in FORMATS if name not in ("layers", "xarray")])
@pytest.mark.parametrize("text", [b"", b"nonsense" * 100])
def test_other_files_get_one_line(tmp_path, name, text, capfd):
    path = tmp_path / name
    path.write_bytes(text)
    if name.startswith(("a.nii", "b.nii")):  # the compiled part has these
        path.write_bytes(b"\x1c\x02\0\0" + text)
    with pytest.raises(isowave.Error) as error:
        isowave.open(path)
    message = str(error.value)
    assert message.startswith(f"{path}: ") and "\n" not in message and len(message) < 450
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name, writer, dataset", [each[:3] for each in FORMATS])
def test_a_missing_package_is_named(tmp_path, monkeypatch, name, writer, dataset):
    needed = {
        ".tif": "tifffile", ".tiff": "tifffile", ".nc": "netCDF4", ".h5": "h5py", ".hdf5": "h5py",
        ".zarr": "zarr", ".mrc": "mrcfile", ".gz": "mrcfile", ".map": "mrcfile", ".nii": "nibabel",
        ".vti": "vtkmodules.vtkIOXML", ".vtk": "vtkmodules.vtkIOLegacy", "": "zarr",
    }  # fmt: skip
    path = tmp_path / name
    writer(path)
    package = needed.get(path.suffix)
    package = {"layers": "tifffile", "b.nii.gz": "nibabel"}.get(name, package)
    if package is None:  # numpy's
        return
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(isowave.Error) as error:
        isowave.open(path, dataset=dataset)
    assert str(error.value) == f"{path}: {package} is missing: pip install 'isowave[files]'"


def test_paths_that_are_not_there(tmp_path):
    for name in ("a.tif", "a.h5", "a.zarr", "a.vtk", "a.dcm"):
        with pytest.raises(isowave.Error, match=f"{name}: No such file"):
            isowave.open(tmp_path / name)
    (tmp_path / "empty").mkdir()
    with pytest.raises(isowave.Error, match="no images of DICOM, no TIFF files and no zarr store"):
        isowave.open(tmp_path / "empty")


@pytest.mark.parametrize(
    "index", ["t", "t=", "t=x", "=1", "t=-1", "t=1,t=2", {"t": 1.5}, 3, {3: 1}]
)
def test_an_index_has_axes_and_entries(index):
    with pytest.raises(ValueError, match="index .*(give axes with an entry|gives axis t twice)"):
        parse_index(index)
    assert parse_index(" t=3, c = 0") == parse_index({"t": 3, "c": np.int64(0)}) == {"t": 3, "c": 0}


def test_names_of_axes():
    assert named_axes(["", "", "", ""]) == ["t", "z", "y", "x"]
    assert named_axes([""] * 6) == ["axis0", "axis1", "axis2", "z", "y", "x"]
    assert named_axes(["lon", "time", "depth", "lat"]) == ["x", "time", "z", "y"]
    assert named_axes(["a", "b", "x", "time"]) == ["z", "y", "x", "time"]
    assert named_axes(["x", "y", "a"], [None, "z", None]) == ["x", "z", "y"]
    with pytest.raises(ValueError, match="axes lat, y, x: two of them are y"):
        named_axes(["lat", "y", "x"])


def test_arrays_of_any_order_of_axes():
    turned = STEPS.transpose(3, 1, 0, 2)  # x, z, t, y
    contents = of_array(turned, ["x", "z", "t", "y"], "a", placement=Placement((2.0, 3.0, 4.0)))
    found = pick(contents, {"t": 1})
    np.testing.assert_array_equal(found.fetch(2, 5), STEPS[1][2:5])
    assert found.shape == VOXELS.shape and found.placement.spacing == (2.0, 3.0, 4.0)
