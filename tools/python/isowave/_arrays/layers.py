"""Reads the layers of a chunked store so that each chunk is fetched once.

A chunk row is all chunks of a store that share their layers along z. Slabs are asked for in
ascending order and need not end where a row ends: the row at a slab's end is kept until the next
slab has taken the rest of it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import bad_value
from .voxels import read_type, to_voxels

Fetch = Callable[[int, int], Any]
"""Layers [z_begin, z_end) of the store as an array (z, y, x) of the store's type."""


class LayerReader:
    """Layers of an array as voxels of one type. Not for several threads at a time.

    fetch       reads layers of the store
    shape       (nz, ny, nx)
    stored      type of the store's voxels
    dtype       type of returned voxels: read_type() of `stored`, or type_with_nan() of that
    row_edges   layers at which chunk rows begin: 0 first, then ascending, all below nz. None
                if all layers are equally cheap to read (memory, files without chunks)
    fill_value  value for masked voxels, a number of dtype; None: they are refused
    what        names the array in messages

    Holds at most one chunk row, and beside it the slab that is being put together.
    """

    def __init__(
        self,
        fetch: Fetch,
        shape: tuple[int, int, int],
        stored: np.dtype[Any],
        dtype: np.dtype[Any],
        row_edges: Sequence[int] | None,
        fill_value: Any,
        what: str,
    ) -> None:
        self._fetch = fetch
        self._shape = shape
        self._stored = stored
        self._dtype = dtype
        self._edges = row_edges
        self._fill_value = fill_value
        self._what = what
        self._row: Any = None
        self._row_begin = 0
        self._row_end = 0

    def read(self, z_begin: int, z_end: int) -> NDArray[Any]:
        """Returns layers [z_begin, z_end), C-contiguous; a view if memory has them so.

        Raises ArrayValueError if the store gives layers of another shape or type than it promised.
        """
        if self._edges is None:
            return self._voxels(self._layers(z_begin, z_end), z_begin)
        if self._row is None and self._is_whole(z_begin, z_end):
            return self._voxels(self._layers(z_begin, z_end), z_begin)
        return self._slab(z_begin, z_end)

    def _slab(self, z_begin: int, z_end: int) -> NDArray[Any]:
        """Puts a slab together from parts of rows, letting go of each row before the next."""
        slab = np.empty((z_end - z_begin, *self._shape[1:]), self._dtype)
        z = z_begin
        while z < z_end:
            self._hold_row(z)
            end = min(z_end, self._row_end)
            # By single layers, so that no converted copy of them lies beside row and slab.
            for layer in range(z, end):
                at = layer - self._row_begin
                slab[layer - z_begin] = self._voxels(self._row[at : at + 1], layer)[0]
            if end == self._row_end:
                self._row = None
            z = end
        return slab

    def _hold_row(self, z: int) -> None:
        """Holds the chunk row that layer z is in."""
        if self._row is not None and self._row_begin <= z < self._row_end:
            return
        self._row = None  # before the next one is there
        assert self._edges is not None
        row = bisect_right(self._edges, z) - 1
        begin = self._edges[row]
        end = self._edges[row + 1] if row + 1 < len(self._edges) else self._shape[0]
        end = min(end, self._shape[0])
        self._row = self._layers(begin, end)
        self._row_begin, self._row_end = begin, end

    def _begins_row(self, z: int) -> bool:
        """Whether no chunk row has layers on both sides of z."""
        assert self._edges is not None
        return z == self._shape[0] or self._edges[bisect_right(self._edges, z) - 1] == z

    def _is_whole(self, z_begin: int, z_end: int) -> bool:
        """Whether layers are whole rows that can be fetched at once, with no slab beside them.

        One row may be converted to another type; several rows would be held twice by that.
        """
        if not self._begins_row(z_begin) or not self._begins_row(z_end):
            return False
        assert self._edges is not None
        is_one = bisect_right(self._edges, z_begin) == bisect_right(self._edges, z_end - 1)
        return is_one or self._stored == self._dtype

    def _layers(self, z_begin: int, z_end: int) -> Any:
        layers = self._fetch(z_begin, z_end)
        expected = (z_end - z_begin, *self._shape[1:])
        if getattr(layers, "shape", None) != expected:
            raise bad_value(
                self._what,
                f"layers {z_begin} to {z_end} came with shape {getattr(layers, 'shape', None)}, "
                f"expected {expected}",
            )
        if read_type(layers.dtype, self._what) != read_type(self._stored, self._what):
            raise bad_value(
                self._what,
                f"layers {z_begin} to {z_end} came as {layers.dtype}, expected {self._stored}",
            )
        return layers

    def _voxels(self, layers: Any, z_begin: int) -> NDArray[Any]:
        return to_voxels(layers, self._dtype, self._fill_value, z_begin, self._what)


def even_rows(chunk_layers: int, num_layers: int, first: int = 0) -> Sequence[int]:
    """Returns the edges of chunk rows of chunk_layers each; the first row may be shorter.

    first  the first edge after layer 0, or 0 if a whole row begins there
    """
    if first == 0:
        return range(0, num_layers, chunk_layers)
    return [0, *range(first, num_layers, chunk_layers)]


def most_layers(row_edges: Sequence[int] | None, num_layers: int) -> int:
    """Returns the layers of the largest chunk row; 1 if there are no rows."""
    if row_edges is None:
        return 1
    if isinstance(row_edges, range):
        return min(row_edges.step, num_layers)
    ends = [*row_edges[1:], num_layers]
    return max(end - begin for begin, end in zip(row_edges, ends))
