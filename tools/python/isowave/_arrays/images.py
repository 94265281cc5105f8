"""Images that know where they lie: SimpleITK, itk, VTK and pyvista."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from .errors import bad_type, bad_value, type_name
from .found import Found
from .grid import Placement, checked_shape, finite_numbers, matrix, vector


def simpleitk_image(image: Any, has_spacing: bool) -> Found:
    """Adapts a SimpleITK.Image of one number per voxel."""
    what = type_name(image)
    _need_scalars(image.GetNumberOfComponentsPerPixel(), what)
    checked_shape(tuple(image.GetSize())[::-1], what)
    if image.GetPixelIDTypeAsString().startswith("label of"):  # a view of it ends the process
        raise bad_type(what, "a label map: SimpleITK.LabelMapToLabel() makes an image")
    array = sys.modules["SimpleITK"].GetArrayViewFromImage(image)
    rows = finite_numbers(image.GetDirection(), 9, what, "direction")
    placement = Placement(
        vector(image.GetSpacing(), what, "spacing"),
        vector(image.GetOrigin(), what, "origin"),
        matrix((rows[0:3], rows[3:6], rows[6:9]), what),
        is_anatomical=True,  # ITK's world is LPS
    )
    # The view does not own its memory: the function holds the image.
    return _of_view(array, what, placement, owner=image)


def itk_image(image: Any, has_spacing: bool) -> Found:
    """Adapts an itk.Image of one number per voxel, with the region that is in memory."""
    what = type_name(image)
    _need_scalars(image.GetNumberOfComponentsPerPixel(), what)
    region = image.GetBufferedRegion()
    checked_shape([int(size) for size in region.GetSize()][::-1], what)
    array = sys.modules["itk"].array_view_from_image(image)
    placement = Placement(
        vector(image.GetSpacing(), what, "spacing"),
        vector(image.GetOrigin(), what, "origin"),
        matrix(np.asarray(image.GetDirection()), what),
        is_anatomical=True,
    )
    first = vector(region.GetIndex(), what, "the region's index")
    return _of_view(array, what, placement, first, owner=image)


def vtk_image(image: Any, has_spacing: bool) -> Found:
    """Adapts a vtkImageData, which pyvista.ImageData is: the active scalars of its points."""
    what = type_name(image)
    nx, ny, nz = (int(size) for size in image.GetDimensions())
    shape = checked_shape((nz, ny, nx), what)
    scalars = image.GetPointData().GetScalars()
    if scalars is None:
        if image.GetCellData().GetScalars() is not None:
            raise bad_value(
                what,
                "its scalars belong to cells, need them at points: use "
                "image.cell_data_to_point_data() or image.cells_to_points()",
            )
        raise bad_value(
            what,
            "its points have no active scalars: set them, for example with "
            "image.set_active_scalars('name')",
        )
    _need_scalars(scalars.GetNumberOfComponents(), what)
    voxels = vtk_voxels(scalars, what)
    if voxels.shape != (nx * ny * nz,):
        raise bad_value(what, f"{voxels.size} scalars for {nz} x {ny} x {nx} points")
    directions = image.GetDirectionMatrix()
    placement = Placement(
        vector(image.GetSpacing(), what, "spacing"),
        vector(image.GetOrigin(), what, "origin"),
        matrix([[directions.GetElement(i, j) for j in range(3)] for i in range(3)], what),
    )
    extent = finite_numbers(image.GetExtent(), 6, what, "extent")
    first = (extent[0], extent[2], extent[4])
    return _of_view(voxels.reshape(shape), what, placement, first, owner=image)


def vtk_dataset(dataset: Any, has_spacing: bool) -> Found:
    """Refuses grids of VTK that are no ImageData, with what makes one of them."""
    raise bad_type(
        type_name(dataset),
        "only ImageData is a volume of even voxels: resample, for example with "
        "pyvista.ImageData(...).sample(mesh)",
    )


def vtk_voxels(scalars: Any, what: str) -> Any:
    """Returns a vtkDataArray's memory as a numpy array."""
    vtk_bit, vtk_char = 1, 2
    kind = int(scalars.GetDataType())
    if kind == vtk_bit:
        raise bad_type(what, "scalars of single bits are not supported: convert them to uint8")
    try:
        view = memoryview(scalars)
    except TypeError:
        raise bad_type(
            what, f"its scalars ({type(scalars).__name__}) do not lie in memory as one array"
        ) from None
    voxels: Any = np.asarray(view)
    # VTK's char, whose buffer has the format of text, is signed on the platforms that we run on.
    return voxels.view(np.int8) if kind == vtk_char else voxels


def _need_scalars(num_components: Any, what: str) -> None:
    if num_components != 1:
        raise bad_value(
            what, f"{num_components} numbers per voxel, need 1: take one component of them"
        )


def _of_view(
    array: Any,
    what: str,
    placement: Placement,
    first_index: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    owner: Any,
) -> Found:
    """Returns what was found of an array (z, y, x) whose memory belongs to `owner`."""

    def fetch(begin: int, end: int, _owner: Any = owner) -> Any:
        return np.asarray(array[begin:end])

    return Found(
        what,
        checked_shape(array.shape, what),
        array.dtype,
        fetch,
        placement=placement,
        first_index=first_index,
    )
