"""Files of each format, written by its own library: voxels of unequal sides, spacing, origin."""

import numpy as np
import pytest
from array_checks import ORIGIN, SPACING, make_voxels

VOXELS = make_voxels("int16")
STEPS = np.stack([VOXELS, VOXELS + 1, VOXELS + 2])
UNIT = (1.0, 1.0, 1.0)
ZERO = (0.0, 0.0, 0.0)


def even(axis, count):
    """Coordinates along z, y or x (0, 1, 2)."""
    return ORIGIN[axis] + SPACING[axis] * np.arange(count)


def tiff(path, voxels=VOXELS, **how):
    tifffile = pytest.importorskip("tifffile")

    how.setdefault("photometric", "minisblack")
    tifffile.imwrite(path, voxels, **how)


def ome_tiff(path, voxels=VOXELS, axes="ZYX", **more):
    z, y, x = SPACING
    sizes = {"PhysicalSizeZ": z, "PhysicalSizeY": y, "PhysicalSizeX": x, **more}
    tiff(path, voxels, metadata={"axes": axes, **sizes}, compression="zlib")


def imagej_tiff(path):
    z, y, x = SPACING
    tiff(
        path, VOXELS.astype("uint16"), imagej=True, resolution=(1 / x, 1 / y),
        metadata={"axes": "ZYX", "spacing": z, "unit": "um"},
    )  # fmt: skip


def tiff_folder(path):
    path.mkdir()
    for i, layer in enumerate(VOXELS):
        tiff(path / f"layer_{i + 7}.tif", layer)  # 10 comes after 9


def netcdf(path, names=("z", "y", "x"), voxels=None, format="NETCDF4"):
    netCDF4 = pytest.importorskip("netCDF4")

    voxels = VOXELS if voxels is None else voxels
    with netCDF4.Dataset(path, "w", format=format) as file:
        for name, size in zip(names, voxels.shape):
            file.createDimension(name, size)
            if name in ("z", "y", "x"):
                axis = file.createVariable(name, "f8", (name,))
                axis[:] = even("zyx".index(name), size)
        file.createVariable("ct", voxels.dtype, names)[:] = voxels


def classic_netcdf(path):
    netcdf(path, format="NETCDF3_64BIT_OFFSET")


def hdf5(path):
    h5py = pytest.importorskip("h5py")

    with h5py.File(path, "w") as file:
        ct = file.create_dataset("scan/ct", data=VOXELS, chunks=(2, 2, 2), compression="gzip")
        ct.attrs["element_size_um"] = SPACING
        file["weights"] = np.zeros(3)


def scaled_hdf5(path):
    """With axes x, z, y, which dimension scales name."""
    h5py = pytest.importorskip("h5py")

    with h5py.File(path, "w") as file:
        file["ct"] = VOXELS.transpose(2, 0, 1)
        for dim, name, axis in zip(file["ct"].dims, "xzy", (2, 0, 1)):
            file[name] = even(axis, VOXELS.shape[axis])
            file[name].make_scale(name)
            dim.attach_scale(file[name])


def ome_zarr(path, voxels=None, further=()):
    """Two levels of detail."""
    zarr = pytest.importorskip("zarr")

    voxels = VOXELS if voxels is None else voxels
    axes = [{"name": name} for name in further]
    axes += [{"name": name, "type": "space"} for name in "zyx"]
    group = zarr.open_group(path, mode="w", zarr_format=3)
    levels = []
    for level in (0, 1):
        every = (slice(None),) * len(further) + (slice(None, None, 2**level),) * 3
        group.create_array(str(level), data=voxels[every], chunks=(1,) * len(further) + (2, 3, 3))
        scale = [1.0] * len(further) + [2.0**level * s for s in SPACING]
        move = [0.0] * len(further) + [*ORIGIN]
        transforms = [
            {"type": "scale", "scale": scale},
            {"type": "translation", "translation": move},
        ]
        levels.append({"path": str(level), "coordinateTransformations": transforms})
    image = {"axes": axes, "datasets": levels}
    group.attrs["ome"] = {"version": "0.5", "multiscales": [image]}


def zarr_array(path):
    zarr = pytest.importorskip("zarr")

    zarr.save(path, VOXELS)


def xarray_zarr(path):
    """By xarray, with axes y, x, z."""
    xarray = pytest.importorskip("xarray")

    coordinates = {name: even("zyx".index(name), VOXELS.shape["zyx".index(name)]) for name in "zyx"}
    array = xarray.DataArray(VOXELS.transpose(1, 2, 0), coordinates, dims=("y", "x", "z"))
    xarray.Dataset({"ct": array, "mean": array.mean("z")}).to_zarr(path, zarr_format=2)


def npy(path):
    np.save(path, np.asfortranarray(VOXELS))


def npz(path):
    np.savez(path, ct=VOXELS, spacing=SPACING)


def mrc(path, voxels=VOXELS, compression=None):
    mrcfile = pytest.importorskip("mrcfile")

    with mrcfile.new(path, compression=compression) as file:
        file.set_data(voxels)
        file.voxel_size = SPACING[::-1]
        file.header.origin = ORIGIN[::-1]


def packed_mrc(path):
    mrc(path, compression="gzip")


def bzip2_mrc(path):
    mrc(path, compression="bzip2")


def turned_mrc(path):
    """Columns along z, rows along x, sections along y; without an origin, but with a start."""
    mrcfile = pytest.importorskip("mrcfile")

    mrc(path, VOXELS.transpose(1, 2, 0))
    with mrcfile.open(path, "r+") as file:
        file.header.mapc, file.header.mapr, file.header.maps = 3, 1, 2
        file.header.cella = tuple(n * s for n, s in zip(VOXELS.shape[::-1], SPACING[::-1]))
        file.header.mx, file.header.my, file.header.mz = VOXELS.shape[::-1]
        file.header.origin = (0, 0, 0)
        file.header.nxstart, file.header.nystart, file.header.nzstart = 5, -10, 40


def vtk_image(cells=False):
    """Voxels at points, or at the middles of cells; its extent does not begin at 0."""
    vtk = pytest.importorskip("vtk")
    numpy_to_vtk = pytest.importorskip("vtk.util.numpy_support").numpy_to_vtk

    first = (2, -3, 4)  # x, y, z
    image = vtk.vtkImageData()
    image.SetExtent(*(
        end for start, n in zip(first, VOXELS.shape[::-1]) for end in (start, start + n - 1 + cells)
    ))  # fmt: skip
    image.SetSpacing(SPACING[::-1])
    image.SetOrigin(*(
        at - step * (start + 0.5 * cells)
        for at, step, start in zip(ORIGIN[::-1], SPACING[::-1], first)
    ))  # fmt: skip
    array = numpy_to_vtk(VOXELS.ravel(), deep=True)
    array.SetName("ct")
    (image.GetCellData() if cells else image.GetPointData()).SetScalars(array)
    return image


def vti(path, cells=False, mode="Appended"):
    vtk = pytest.importorskip("vtk")

    writer = vtk.vtkXMLImageDataWriter()
    writer.SetInputData(vtk_image(cells))
    writer.SetFileName(str(path))
    getattr(writer, f"SetDataModeTo{mode}")()
    assert writer.Write() == 1


def vti_of_cells(path):
    vti(path, cells=True, mode="Binary")


def vti_in_parts(path):
    """Two files, cut along z, and one that names them."""
    vtk = pytest.importorskip("vtk")

    writer = vtk.vtkXMLPImageDataWriter()
    writer.SetInputData(vtk_image())
    writer.SetFileName(str(path))
    writer.SetNumberOfPieces(2)
    writer.SetStartPiece(0)
    writer.SetEndPiece(1)
    assert writer.Write() == 1


def legacy_vtk(path, mode="Binary"):
    vtk = pytest.importorskip("vtk")

    writer = vtk.vtkStructuredPointsWriter()
    writer.SetInputData(vtk_image())
    writer.SetFileName(str(path))
    getattr(writer, f"SetFileTypeTo{mode}")()
    assert writer.Write() == 1


def ascii_vtk(path):
    legacy_vtk(path, "ASCII")


def nifti2(path, voxels=VOXELS, kind="Nifti2Image"):
    """In nibabel's RAS, whose axes x and y are opposite to ours."""
    nibabel = pytest.importorskip("nibabel")

    affine = np.diag([-SPACING[2], -SPACING[1], SPACING[0], 1.0])
    affine[:3, 3] = -ORIGIN[2], -ORIGIN[1], ORIGIN[0]
    nibabel.save(getattr(nibabel, kind)(voxels.T, affine), path)


#: name of the file, its writer, dataset, spacing and origin that it has
FORMATS = [
    ("plain.tif", tiff, None, UNIT, ZERO),
    ("a.ome.tif", ome_tiff, None, SPACING, ZERO),
    ("ij.tiff", imagej_tiff, None, SPACING, ZERO),
    ("layers", tiff_folder, None, UNIT, ZERO),
    ("a.nc", netcdf, None, SPACING, ORIGIN),
    ("classic.nc", classic_netcdf, "ct", SPACING, ORIGIN),
    ("a.h5", hdf5, None, SPACING, ZERO),
    ("b.hdf5", scaled_hdf5, "ct", SPACING, ORIGIN),
    ("ome.zarr", ome_zarr, None, SPACING, ORIGIN),
    ("a.zarr", zarr_array, None, UNIT, ZERO),
    ("xarray", xarray_zarr, None, SPACING, ORIGIN),
    ("a.npy", npy, None, UNIT, ZERO),
    ("a.npz", npz, "ct", UNIT, ZERO),
    ("a.mrc", mrc, None, SPACING, ORIGIN),
    ("a.mrc.gz", packed_mrc, None, SPACING, ORIGIN),
    ("a.mrc.bz2", bzip2_mrc, None, SPACING, ORIGIN),
    ("a.rec", mrc, None, SPACING, ORIGIN),
    ("turned.map", turned_mrc, None, SPACING, (15.0, 20.0, -20.0)),
    ("a.vti", vti, None, SPACING, ORIGIN),
    ("cells.vti", vti_of_cells, "ct", SPACING, ORIGIN),
    ("parts.pvti", vti_in_parts, None, SPACING, ORIGIN),
    ("a.vtk", legacy_vtk, None, SPACING, ORIGIN),
    ("ascii.vtk", ascii_vtk, None, SPACING, ORIGIN),
    ("a.nii", nifti2, None, SPACING, ORIGIN),
    ("b.nii.gz", nifti2, None, SPACING, ORIGIN),
]
