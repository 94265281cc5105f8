"""Draws on the host while a device is prepared: the same bits, at once."""

from __future__ import annotations

from dataclasses import replace

from isowave import _core
from isowave._camera import Camera
from isowave._image import Image
from isowave._levels import Voxels
from isowave._renderer import draw
from isowave._request import Request

from .interfaces import RendererLike, VolumeLike


class HostRenderer:
    """isowave's renderer of the host, with the interface of isowave.Renderer.

    It draws full detail, whatever error or time is asked for, and knows no bounds.
    """

    def __init__(self, volume: Voxels) -> None:
        # A quarter of the host's memory at most; raises isowave.Error where that is not enough.
        self._core = _core.host_renderer(volume._core, 0)
        self.device = {"name": "host", "memory_bytes": 0}

    @property
    def memory_bytes(self) -> int:
        return 0

    def camera(self, isovalue: float, size: tuple[int, int]) -> Camera:
        return Camera(*self._core.camera(isovalue, *size))

    def draw(self, request: Request) -> Image:
        request = replace(request, max_error=None, time_budget=None)
        return Image(draw(self._core, request, interrupts=False), request)


def make_host(volume: VolumeLike) -> RendererLike | None:
    """A renderer of the host for a volume of isowave's; None for others."""
    return HostRenderer(volume) if isinstance(volume, Voxels) else None
