"""What the viewer needs of isowave's classes. Tests have others that do as much."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from isowave._camera import Camera
from isowave._request import Request


class ImageLike(Protocol):
    """What the viewer needs of isowave.Image."""

    @property
    def rgb(self) -> NDArray[np.uint8] | None:
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
    """What the viewer needs of what on_pass gets."""

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
    """What the viewer needs of isowave.Renderer."""

    @property
    def device(self) -> Mapping[str, Any]:
        ...

    @property
    def memory_bytes(self) -> int:
        ...

    def camera(self, isovalue: float, size: tuple[int, int]) -> Camera:
        ...

    def draw(self, request: Request) -> ImageLike:
        ...


class VolumeLike(Protocol):
    """What the viewer needs of isowave.Volume."""

    @property
    def shape(self) -> tuple[int, int, int]:
        ...

    @property
    def spacing(self) -> tuple[float, float, float]:
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

    def isovalue_notice(self, isovalue: float) -> str:
        ...

    def histogram(self, bins: int = 256) -> tuple[NDArray[Any], NDArray[Any]]:
        ...

    def renderer(self, **options: Any) -> RendererLike:
        ...
