"""The compiled part (module.cpp). Axes are x, y, z here."""

from collections.abc import Callable
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

__version__: str

class Error(RuntimeError): ...

Vector = tuple[float, float, float] | list[float]
Index3 = tuple[int, int, int]
CameraTuple = tuple[
    tuple[float, float, float], tuple[float, float, float], tuple[float, float, float], float
]

def is_ending() -> bool: ...
def devices() -> list[dict[str, Any]]: ...
def encode_png(picture: NDArray[np.uint8]) -> bytes: ...
def save_png(picture: NDArray[np.uint8], path: str | PathLike[str]) -> None: ...

class Volume:
    @property
    def dims(self) -> list[int]: ...
    @property
    def spacing(self) -> list[float]: ...
    @property
    def origin(self) -> list[float]: ...
    @property
    def direction(self) -> list[list[float]]: ...
    @property
    def source_type(self) -> str: ...
    @property
    def value_range(self) -> list[float]: ...
    @property
    def bits_per_voxel(self) -> float: ...
    @property
    def compressed_bytes(self) -> int: ...
    @property
    def max_voxel_error(self) -> float | None: ...
    @property
    def num_levels(self) -> int: ...
    def level_dims(self, level: int) -> list[int]: ...
    def decode(
        self, level: int, begin: Index3, end: Index3, step: Index3
    ) -> NDArray[np.float32]: ...
    def sample(self, max_voxels: int) -> NDArray[np.float32]: ...
    def save(self, path: str | PathLike[str]) -> None: ...
    def extract(
        self,
        device: str,
        isovalue: float,
        level: int,
        normals: bool,
        memory_budget: int,
        progress: Callable[[str, float], object] | None,
    ) -> dict[str, NDArray[Any]]: ...

def compress(
    read: Callable[[int, int], NDArray[Any]],
    type: str,
    dims: tuple[int, int, int],
    spacing: Vector,
    origin: Vector,
    direction: list[Vector],
    options: dict[str, Any],
    keep: bool,
    path: str | PathLike[str] | None,
    progress: Callable[[str, float], object] | None,
) -> Volume: ...
def compress_array(
    array: NDArray[Any],
    type: str,
    dims: tuple[int, int, int],
    spacing: Vector,
    origin: Vector,
    direction: list[Vector],
    options: dict[str, Any],
    progress: Callable[[str, float], object] | None,
) -> Volume: ...
def open(
    path: str | PathLike[str],
    options: dict[str, Any],
    dims: tuple[int, int, int] | None,
    type: str | None,
    spacing: Vector | None,
    progress: Callable[[str, float], object] | None,
) -> Volume: ...

class PassView:
    @property
    def passes(self) -> int: ...
    @property
    def completed_percent(self) -> float: ...
    def picture(self) -> NDArray[np.uint8]: ...

class HostRenderer:
    def __init__(self, volume: Volume, memory_limit: int) -> None: ...
    def render(
        self,
        request: dict[str, Any],
        on_pass: Callable[[PassView], bool | None] | None,
        interrupts: bool,
    ) -> dict[str, Any]: ...
    def cast_rays(
        self, rays: NDArray[np.float64], isovalue: float, smooth: bool
    ) -> dict[str, Any]: ...
    def camera(self, isovalue: float, width: int, height: int) -> CameraTuple: ...
    @property
    def memory_bytes(self) -> int: ...

class Renderer:
    def __init__(self, device: str, volume: Volume, options: dict[str, Any]) -> None: ...
    def render(
        self,
        request: dict[str, Any],
        on_pass: Callable[[PassView], bool | None] | None,
        interrupts: bool,
    ) -> dict[str, Any]: ...
    def cast_rays(
        self, rays: NDArray[np.float64], isovalue: float, smooth: bool
    ) -> dict[str, Any]: ...
    def camera(self, isovalue: float, width: int, height: int) -> CameraTuple: ...
    @property
    def device(self) -> dict[str, Any]: ...
    @property
    def ready(self) -> bool: ...
    def wait(self) -> None: ...
    @property
    def memory_bytes(self) -> int: ...

class BrickRenderer:
    def __init__(
        self,
        processes: object,
        path: str | PathLike[str],
        compression: dict[str, Any],
        options: dict[str, Any],
    ) -> None: ...
    def render(self, request: dict[str, Any]) -> dict[str, Any]: ...
    def camera(self, isovalue: float, width: int, height: int) -> CameraTuple: ...
    @property
    def device(self) -> dict[str, Any]: ...
    @property
    def dims(self) -> list[int]: ...
    @property
    def spacing(self) -> list[float]: ...
    @property
    def origin(self) -> list[float]: ...
    @property
    def direction(self) -> list[list[float]]: ...

def save_mesh(
    vertices: NDArray[np.float32],
    faces: NDArray[np.uint32],
    normals: NDArray[np.float32] | None,
    path: str | PathLike[str],
) -> None: ...
