"""Draws on the host while a device is prepared: the same bits, at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from isowave import _core
from isowave._camera import Camera
from isowave._image import Image
from isowave._levels import Voxels
from isowave._renderer import draw, request_for

from .interfaces import RendererLike, VolumeLike


class HostRenderer:
    """isowave's renderer of the host, with the interface of isowave.Renderer.

    It draws full detail, whatever error or time is asked for, and knows no bounds.
    """

    def __init__(self, volume: Voxels) -> None:
        # A quarter of the host's memory at most; raises isowave.Error where that is not enough.
        self._core = _core.HostRenderer(volume._core, 0)
        self.device = {"name": "host", "memory_bytes": 0}

    @property
    def memory_bytes(self) -> int:
        return 0

    def camera(self, isovalue: float, size: tuple[int, int]) -> Camera:
        return Camera(*self._core.camera(isovalue, *size))

    def render(
        self,
        isovalue: float,
        *,
        camera: Camera,
        size: tuple[int, int],
        samples: int,
        color: tuple[float, float, float],
        background: tuple[float, float, float],
        outputs: Sequence[str],
        max_error: float | None,
        time_budget: float | None,
        ambient: int,
        on_pass: Callable[[Any], bool] | None,
    ) -> Image:
        request = request_for(
            isovalue,
            camera,
            size,
            samples=samples,
            color=color,
            background=background,
            outputs=outputs,
            ambient=ambient,
        )
        frame = draw(self._core, request, on_pass, interrupts=False)
        return Image(frame, camera, isovalue, samples, background)


def make_host(volume: VolumeLike) -> RendererLike | None:
    """A renderer of the host for a volume of isowave's; None for others."""
    return HostRenderer(volume) if isinstance(volume, Voxels) else None
