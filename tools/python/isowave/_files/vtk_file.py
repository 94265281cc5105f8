"""VTK's image data: XML (.vti, .pvti), which is read by layers, and legacy (.vtk), read whole.

Arrays of cells are volumes of their own, whose voxels lie at the middles of the cells.
"""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from isowave._arrays.errors import bad_value
from isowave._arrays.found import Found
from isowave._arrays.grid import Placement, checked_shape
from isowave._arrays.images import vtk_voxels

from .contents import Contents, choose

Extent = tuple[int, int, int, int, int, int]
Load = Callable[[Extent], Any]
"""Returns a vtkImageData that has at least the points of an extent."""


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Raises the first of VTK's errors, in place of a print of all."""
    core = importlib.import_module("vtkmodules.vtkCommonCore")
    window, before = core.vtkStringOutputWindow(), core.vtkOutputWindow.GetInstance()
    verbosity = core.vtkLogger.GetCurrentVerbosityCutoff()
    core.vtkOutputWindow.SetInstance(window)
    core.vtkLogger.SetStderrVerbosity(core.vtkLogger.VERBOSITY_OFF)
    try:
        yield
    finally:
        core.vtkOutputWindow.SetInstance(before)
        core.vtkLogger.SetStderrVerbosity(verbosity)
    _, _, error = window.GetOutput().partition("ERROR: In ")
    if error:  # "FILE, line N", then "OBJECT (ADDRESS): TEXT", then an empty line
        text = error.partition("\n")[2].partition("\n\n")[0]
        raise ValueError(text.partition("): ")[2] or text)


def read_xml(path: str, dataset: str | None, has_spacing: bool) -> Contents:
    """See kinds.Reader. A dataset is the name of an array of points or cells."""
    module = importlib.import_module("vtkmodules.vtkIOXML")
    is_parallel = path.lower().endswith(".pvti")
    reader = module.vtkXMLPImageDataReader() if is_parallel else module.vtkXMLImageDataReader()
    reader.SetFileName(path)
    with _quiet():
        reader.UpdateInformation()
    information = reader.GetOutputInformation(0)
    pipeline = importlib.import_module("vtkmodules.vtkCommonExecutionModel")
    extent = information.Get(pipeline.vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT())
    if extent is None:
        raise bad_value("file", "it is not VTK's ImageData")

    def load(asked: Extent) -> Any:
        with _quiet():
            reader.UpdateExtent(asked)
        return reader.GetOutput()

    kinds = (
        (False, reader.GetPointDataArraySelection()),
        (True, reader.GetCellDataArraySelection()),
    )
    names = {
        selection.GetArrayName(i): is_of_cells
        for is_of_cells, selection in kinds
        for i in range(selection.GetNumberOfArrays())
    }
    name = choose(dict.fromkeys(names, 3), dataset)
    for _, selection in kinds:
        for i in range(selection.GetNumberOfArrays()):
            each = selection.GetArrayName(i)
            selection.SetArraySetting(each, int(each == name))
    return _contents(load, tuple(extent), name, names[name])


def read_legacy(path: str, dataset: str | None, has_spacing: bool) -> Contents:
    """See kinds.Reader. A dataset is the name of an array of points or cells."""
    reader = importlib.import_module("vtkmodules.vtkIOLegacy").vtkDataSetReader()
    reader.SetFileName(path)
    for read_all in (reader.ReadAllScalarsOn, reader.ReadAllVectorsOn, reader.ReadAllFieldsOn):
        read_all()
    with _quiet():
        reader.Update()
    image = reader.GetOutput()
    if image is None or not image.IsA("vtkImageData"):
        kind = "no VTK file" if image is None else image.GetClassName()
        raise bad_value(kind, "only STRUCTURED_POINTS is a volume of even voxels: resample it")
    names = {
        data.GetArrayName(i): data is image.GetCellData()
        for data in (image.GetCellData(), image.GetPointData())
        for i in range(data.GetNumberOfArrays())
    }
    name = choose(dict.fromkeys(names, 3), dataset)
    return _contents(lambda extent: image, tuple(image.GetExtent()), name, names[name])


def _contents(load: Load, extent: Any, name: str, is_of_cells: bool) -> Contents:
    """extent: first and last points along x, y and z."""
    x0, x1, y0, y1, z0, z1 = extent
    last = 0 if is_of_cells else 1
    shape = checked_shape((z1 - z0 + last, y1 - y0 + last, x1 - x0 + last), name)

    def layers(begin: int, end: int) -> Any:
        """[z, y, x, component]"""
        image = load((x0, x1, y0, y1, z0 + begin, z0 + end - last))
        array = (image.GetCellData() if is_of_cells else image.GetPointData()).GetArray(name)
        if array is None:
            raise bad_value(name, "the file does not have its voxels")
        first = image.GetExtent()[4]
        voxels = vtk_voxels(array, name).reshape(-1, *shape[1:], array.GetNumberOfComponents())
        return voxels[z0 + begin - first : z0 + end - first]

    some = layers(0, 1)

    def volume(index: Mapping[str, int]) -> Found:
        placement = _placement(load((x0, x1, y0, y1, z0, z0 + 1 - last)))
        half = 0.5 if is_of_cells else 0.0
        return Found(
            name,
            shape,
            some.dtype,
            lambda begin, end: layers(begin, end)[..., index["c"]],
            placement=placement,
            first_index=(x0 + half, y0 + half, z0 + half),
        )

    return Contents(name, {"c": int(some.shape[3])}, volume)


def _placement(image: Any) -> Placement:
    matrix = image.GetDirectionMatrix()
    rows: Any = tuple(tuple(matrix.GetElement(i, j) for j in range(3)) for i in range(3))
    return Placement(tuple(image.GetSpacing()), tuple(image.GetOrigin()), rows)
