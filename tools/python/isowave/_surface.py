"""Surfaces of a picture of several, or of translucent ones."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from isowave import _core
from isowave._camera import vector
from isowave._checked import flag, number, numbers, refuse, whole

#: "#rrggbb", a name such as "bone", "skin" or "orange", or red, green, blue from 0 to 1.
Color = str | Sequence[float]

MAX_SURFACES = 8  # of a picture
MAX_LABEL = 65535


@dataclass(frozen=True)
class Surface:
    """An isosurface of a picture, for Renderer.render(surfaces=[...]), or the surface of labels.

    What lies behind translucent surfaces is seen through them. At most 16 crossings of a ray are
    drawn; statistics["rays_cut"] counts the rays that have more. Depth, normals, position, surface
    and cap of the picture are those of each ray's first crossing.

    Surface(labels=[5, 7]) is the surface of a group of a segmentation's labels: that of their
    indicator, which is 1 at voxels with one of the labels and 0 at the others, at 0.5. The voxels
    are integers from 0 to 65,535, compressed without a loss. A picture has surfaces of labels
    alone, or none.
    """

    isovalue: float | None = None  #: None: of labels
    color: Color | None = None  #: None: one unlike those of the picture's other surfaces
    opacity: float = 1.0  #: of each crossing, above 0; at 1, nothing behind the surface is seen
    clipped: bool = True  #: False: clipping planes leave it whole
    labels: int | Sequence[int] = ()  #: instead of an isovalue
    mapped: bool = True  #: False: color_map leaves it its own colour

    @property
    def values(self) -> list[float]:
        """The labels, or the isovalue."""
        if self.isovalue is not None:
            return [self.isovalue]
        return [float(label) for label in labels_of(self.labels)]

    @property
    def text(self) -> str:
        """ "isovalue 5", "label 5"."""
        values = self.values
        shown = ", ".join(f"{value:g}" for value in values[:8]) + (", ..." if values[8:] else "")
        kind = "label" if self.isovalue is None else "isovalue"
        return f"{kind}{'s' if len(values) > 1 else ''} {shown}"


def labels_of(labels: object) -> tuple[int, ...]:
    """Labels in their order, once each. Raises TypeError, ValueError."""
    if isinstance(labels, (str, bytes)) or not isinstance(labels, Iterable):
        labels = (labels,)
    return tuple(sorted({whole("Surface.labels", label, MAX_LABEL) for label in labels}))


def surface_for_core(surface: Surface) -> dict[str, Any]:
    """The surface as fields of isowave::Surface."""
    unused = "isovalue" if surface.labels else "labels"
    return {name: value for name, value in vars(surface).items() if name != unused}


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
    color, labels = surface.color, labels_of(surface.labels)
    if labels and surface.isovalue is not None:
        raise TypeError("Surface: give an isovalue or labels, not both")
    if not labels and surface.isovalue is None:
        raise TypeError("Surface: give an isovalue, or labels")
    return Surface(
        None if labels else number("Surface.isovalue", surface.isovalue),
        rounded(_core.surface_color(index)) if color is None else color_of(color),
        number("Surface.opacity", surface.opacity),
        flag("Surface.clipped", surface.clipped),
        labels,
        flag("Surface.mapped", surface.mapped),
    )
