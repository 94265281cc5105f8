"""Reads arrays of all packages: every object with a volume comes in through as_source().

    array -> adapter of its package -> Found -> as_source() -> ArraySource -> the compressor
             memory, stores,           what     checks the
             labelled, images, nifti   is there grid

| module | what is in it |
|---|---|
| source | as_source(), ArraySource, which class has which adapter |
| memory, stores, ome_zarr, labelled, images, nifti | the adapters |
| found | an adapter's description of an array |
| grid | spacing, origin, direction; the rules of core/volume |
| voxels | stored types -> types that isowave reads |
| layers | chunk rows, each read once |
| errors | ValueError and TypeError of one line |
"""

from .errors import ArrayTypeError, ArrayValueError
from .source import ArraySource, as_source, source_of

__all__ = ["ArraySource", "ArrayTypeError", "ArrayValueError", "as_source", "source_of"]
