"""Surfaces of a picture of several, or of translucent ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isowave import _core
from isowave._camera import vector
from isowave._checked import flag, number, numbers, refuse

#: "#rrggbb", a name such as "bone", "skin" or "orange", or red, green, blue from 0 to 1.
Color = str | Sequence[float]

MAX_SURFACES = 8  # of a picture


@dataclass(frozen=True)
class Surface:
    """An isosurface of a picture, for Renderer.render(surfaces=[...]).

    What lies behind translucent surfaces is seen through them. At most 16 crossings of a ray are
    drawn; statistics["rays_cut"] counts the rays that have more. Depth, normals, position, surface
    and cap of the picture are those of each ray's first crossing.
    """

    isovalue: float
    color: Color | None = None  #: None: one unlike those of the picture's other surfaces
    opacity: float = 1.0  #: of each crossing, above 0; at 1, nothing behind the surface is seen
    clipped: bool = True  #: False: clipping planes leave it whole


def color_of(color: Color) -> tuple[float, float, float]:
    if isinstance(color, str):
        try:
            parts = _core.parse_color(color)
        except _core.Error as error:
            raise ValueError(f"{error}, or red, green, blue from 0 to 1") from None
        return rounded(parts)
    color = numbers("color", color, 3)
    if not all(0 <= part <= 1 for part in color):
        raise ValueError(f"color {tuple(color)}: give red, green and blue, from 0 to 1")
    return vector(color)


def rounded(parts: Sequence[float]) -> tuple[float, float, float]:
    """A colour of 8 bits a part, as Python divides its parts by 255."""
    return vector(round(255 * part) / 255 for part in parts)


def surfaces_of(surfaces: object) -> tuple[Surface, ...]:
    """The argument `surfaces`, with all colours. Raises TypeError, ValueError."""
    if not isinstance(surfaces, Sequence):
        raise refuse("surfaces", surfaces, "a list of isowave.Surface")
    return tuple(surface_of(surface, index) for index, surface in enumerate(surfaces))


def surface_of(surface: object, index: int) -> Surface:
    if not isinstance(surface, Surface):
        raise refuse("surfaces", surface, "an isowave.Surface")
    color = surface.color
    return Surface(
        number("Surface.isovalue", surface.isovalue),
        rounded(_core.surface_color(index)) if color is None else color_of(color),
        number("Surface.opacity", surface.opacity),
        flag("Surface.clipped", surface.clipped),
    )
