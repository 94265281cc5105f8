"""Draws on the host while a device is prepared: the same bits, at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from .interfaces import RendererLike, VolumeLike

if TYPE_CHECKING:
    from isowave import Camera, Image, Volume


class HostRenderer:
    """isowave's renderer of the host, with the interface of isowave.Renderer.

    It draws full detail, whatever error or time is asked for, and knows no bounds.
    """

    def __init__(self, volume: Volume) -> None:
        from isowave import _core

        # A quarter of the host's memory at most; raises isowave.Error where that is not enough.
        self._core = _core.HostRenderer(volume._core, 0)
        self.device = {"name": "host", "memory_bytes": 0}

    @property
    def memory_bytes(self) -> int:
        return 0

    def camera(self, isovalue: float, size: tuple[int, int]) -> Camera:
        from isowave import Camera

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
        from isowave._renderer import Image, draw, request_for

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
    from isowave import Volume

    return HostRenderer(volume) if isinstance(volume, Volume) else None
