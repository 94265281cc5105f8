"""The interfaces that the viewer needs of isowave's classes. Tests have classes of their own."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from isowave._camera import Camera
from isowave._placed import Vector
from isowave._request import Request

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from isowave._renderer import RendererArguments


class ImageLike(Protocol):
    """The part of isowave.Image that the viewer needs."""

    @property
    def rgb(self) -> NDArray[np.uint8] | None:
        ...

    @property
    def rgba(self) -> NDArray[np.uint8]:
        ...

    @property
    def statistics(self) -> Mapping[str, Any]:
        ...

    @property
    def complete(self) -> bool:
        ...

    @property
    def depth(self) -> NDArray[np.float32] | None:
        ...

    @property
    def bounds(self) -> NDArray[np.float32] | None:
        ...


class ProgressLike(Protocol):
    """The part of the argument of on_pass that the viewer needs."""

    @property
    def passes(self) -> int:
        ...

    @property
    def completed_percent(self) -> float:
        ...

    @property
    def rgb(self) -> NDArray[np.uint8]:
        ...


class RendererLike(Protocol):
    """The part of isowave.Renderer that the viewer needs."""

    @property
    def device(self) -> Mapping[str, Any]:
        ...

    @property
    def memory_bytes(self) -> int:
        ...

    def camera(self, *, size: tuple[int, int]) -> Camera:
        ...

    def draw(self, request: Request) -> ImageLike:
        ...


class VolumeLike(Protocol):
    """The part of isowave.Volume that the viewer needs."""

    @property
    def shape(self) -> tuple[int, int, int]:
        ...

    @property
    def spacing(self) -> tuple[float, float, float]:
        ...

    @property
    def origin(self) -> tuple[float, float, float]:
        ...

    @property
    def direction(self) -> NDArray[np.float64]:
        ...

    @property
    def anatomical(self) -> bool:
        ...

    @property
    def box(self) -> tuple[Vector, Vector]:
        ...

    @property
    def source_dtype(self) -> np.dtype[Any]:
        ...

    @property
    def value_range(self) -> tuple[float, float]:
        ...

    @property
    def nbytes(self) -> int:
        ...

    @property
    def bits_per_voxel(self) -> float:
        ...

    @property
    def max_error(self) -> float | None:
        ...

    @property
    def num_levels(self) -> int:
        ...

    def __getitem__(self, key: Any) -> Any:
        ...

    def isovalue_notice(self, isovalue: float) -> str:
        ...

    def suggested_isovalues(self) -> list[float]:
        ...

    def histogram(self, bins: int = 256) -> tuple[NDArray[Any], NDArray[Any]]:
        ...

    def renderer(self, **options: Unpack[RendererArguments]) -> RendererLike:
        ...

    def save_page(
        self, fields: dict[str, Any], path: str | os.PathLike[str], title: str, field: Any
    ) -> None:
        ...


@runtime_checkable
class SeriesLike(Protocol):
    """The part of isowave.Series that the viewer needs: volumes on one grid."""

    @property
    def names(self) -> Sequence[str]:
        ...

    def __len__(self) -> int:
        ...

    def __getitem__(self, step: int) -> Any:
        ...
