"""Where a volume lies: the compiled part's axes x, y, z as z, y, x."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from isowave._core import Voxels


class _Grid(Protocol):
    @property
    def dims(self) -> list[int]:
        ...

    @property
    def spacing(self) -> list[float]:
        ...

    @property
    def origin(self) -> list[float]:
        ...

    @property
    def direction(self) -> list[list[float]]:
        ...

    @property
    def is_anatomical(self) -> bool:
        ...


Vector = tuple[float, float, float]
Core = TypeVar("Core", bound=_Grid)


class Placed(Generic[Core]):
    """Shape and place of a whole volume: a Volume's own, or the one that bricks are parts of."""

    _core: Core

    @property
    def shape(self) -> tuple[int, int, int]:
        """Voxels along (z, y, x)."""
        x, y, z = self._core.dims
        return z, y, x

    @property
    def spacing(self) -> tuple[float, float, float]:
        """World units between voxels along (z, y, x)."""
        x, y, z = self._core.spacing
        return z, y, x

    @property
    def origin(self) -> tuple[float, float, float]:
        """World position of voxel (0, 0, 0), as (z, y, x)."""
        x, y, z = self._core.origin
        return z, y, x

    @property
    def direction(self) -> npt.NDArray[np.float64]:
        """3 x 3; column a: unit world direction (x, y, z) of index axis a, in the order x, y, z."""
        columns: npt.NDArray[np.float64] = np.asarray(self._core.direction, dtype=np.float64)
        return np.ascontiguousarray(columns.T)

    @property
    def _grid(self) -> Voxels:
        """For the compiled part; the type of voxels has no effect on views."""
        core = self._core
        x, y, z = core.dims
        columns: Any = core.direction
        return "uint8", (x, y, z), core.spacing, core.origin, columns, core.is_anatomical

    @property
    def anatomical(self) -> bool:
        """Whether world space is a patient's, LPS: +x left, +y posterior, +z superior."""
        return self._core.is_anatomical

    @property
    def up(self) -> Vector:
        """Direction (x, y, z) that is up: +z, superior, if the volume is anatomical, else +y."""
        return (0.0, 0.0, 1.0) if self.anatomical else (0.0, 1.0, 0.0)

    @property
    def box(self) -> tuple[Vector, Vector]:
        """Corners (x, y, z) of the least box around the volume with edges along the world's axes,
        as clip_box() takes them."""
        edges = self.direction * self.spacing[::-1] * (np.array(self.shape[::-1]) - 1)
        origin = np.array(self.origin[::-1])
        x0, y0, z0 = (float(v) for v in origin + np.minimum(edges, 0).sum(axis=1))
        x1, y1, z1 = (float(v) for v in origin + np.maximum(edges, 0).sum(axis=1))
        return (x0, y0, z0), (x1, y1, z1)
