"""A reader of isowave's .zfp files for ParaView, at a chosen level of detail.

In ParaView: Tools, Manage Plugins, Load New, this file; files of type .zfp can then be opened. In
pvpython:

    from paraview.simple import *

    LoadPlugin(".../isowave/paraview_reader.py", ns=globals())
    head = IsowaveReader(FileName="head.zfp", Level=1)

The package must be made for ParaView's version of Python. It is found beside this file, so
that ParaView need not know of a virtual environment.
"""

# mypy: disable-error-code="misc, untyped-decorator, no-untyped-call, no-any-unimported"

from __future__ import annotations

import os
import sys
from typing import Any

from paraview import print_error  # type: ignore[import-not-found, unused-ignore]
from paraview.util.vtkAlgorithm import (  # type: ignore[import-not-found, unused-ignore]
    VTKPythonAlgorithmBase,
    smdomain,
    smhint,
    smproperty,
    smproxy,
)
from vtkmodules.numpy_interface import dataset_adapter
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline

try:
    import isowave
except ImportError:
    sys.path.append(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    import isowave


@smproxy.reader(
    name="IsowaveReader",
    label="Isowave Reader",
    extensions="zfp",
    file_description="isowave's compressed volumes",
)
class IsowaveReader(VTKPythonAlgorithmBase):
    """vtkImageData of a level: point array "voxels", float32; spacing, origin and direction.

    ParaView draws volumes and slices by their direction; Contour of ParaView 5.11 ignores it.
    """

    def __init__(self) -> None:
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkImageData")
        self._path: str | None = None
        self._level = 0
        self._volume: isowave.Volume | None = None

    @smproperty.stringvector(name="FileName", panel_visibility="never")
    @smdomain.filelist()
    @smhint.filechooser(extensions="zfp", file_description="isowave's compressed volumes")
    def SetFileName(self, path: str | None) -> None:
        path = None if path in (None, "", "None") else path
        if path != self._path:
            self._path, self._volume = path, None
            self.Modified()

    @smproperty.intvector(name="Level", default_values=0)
    @smdomain.intrange(min=0, max=15)
    def SetLevel(self, level: int) -> None:
        """Level of detail. 0: the volume itself; each has half the voxels of the last along each
        axis. A number beyond the coarsest means the coarsest."""
        if level != self._level:
            self._level = level
            self.Modified()

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        volume = self._open()
        if volume is None:
            return 0
        level = self._level_of(volume)
        extent = [bound for n in volume.level_shape(level)[::-1] for bound in (0, n - 1)]
        info = outputs.GetInformationObject(0)
        info.Set(Pipeline.WHOLE_EXTENT(), extent, 6)
        info.Set(vtkDataObject.SPACING(), self._spacing(volume), 3)
        info.Set(vtkDataObject.ORIGIN(), list(volume.origin[::-1]), 3)
        info.Set(vtkDataObject.DIRECTION(), volume.direction.ravel().tolist(), 9)
        vtkDataObject.SetPointDataActiveScalarInfo(info, 10, 1)  # 10: VTK_FLOAT
        return 1

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        volume = self._open()
        if volume is None:
            return 0
        output = vtkImageData.GetData(outputs, 0)
        wanted = outputs.GetInformationObject(0).Get(Pipeline.UPDATE_EXTENT())
        if wanted[1] < wanted[0]:  # of several servers, the first reads
            return 1
        level = self._level_of(volume)
        try:
            voxels = volume.decode(level)
        except (isowave.Error, MemoryError) as error:
            print_error(f"isowave: {self._path}: {error}")
            return 0
        output.SetDimensions(voxels.shape[::-1])
        output.SetSpacing(self._spacing(volume))
        output.SetOrigin(volume.origin[::-1])
        output.SetDirectionMatrix(volume.direction.ravel().tolist())
        # VTK's x runs fastest, as does the last axis here. It keeps the array, without a copy.
        dataset_adapter.WrapDataObject(output).PointData.append(voxels.reshape(-1), "voxels")
        output.GetPointData().SetActiveScalars("voxels")
        return 1

    def _open(self) -> isowave.Volume | None:
        """The volume, opened once; None after a line on what is wrong."""
        if self._volume is None:
            if self._path is None:
                print_error("isowave: no file is named")
                return None
            try:
                self._volume = isowave.open(self._path, progress=False)
            except isowave.Error as error:
                print_error(f"isowave: {error}")
        return self._volume

    def _level_of(self, volume: isowave.Volume) -> int:
        return max(0, min(self._level, volume.num_levels - 1))

    def _spacing(self, volume: isowave.Volume) -> list[float]:
        return [2.0 ** self._level_of(volume) * s for s in volume.spacing[::-1]]
