"""Files that packages of Python read: a path comes in through source_of_file().

    path -> reader of its kind -> Contents -> the volume at an index -> Found -> ArraySource
            kinds                 contents                              isowave._arrays

| module | what is in it |
|---|---|
| kinds | which reader a path has; errors with the path; source_of_file() |
| contents | an array with further axes than z, y and x; choosing by dataset and index |
| order | natural order of names |
| tiff, dicom, hdf5, netcdf, zarr_store, numpy_file, mrc, vtk_file, nifti2 | the readers |

A reader imports its package when it is called. The packages are those of `isowave[files]`. Files of
all other formats go to the compiled part (core/io).
"""

from .contents import Index, parse_index
from .kinds import (
    are_layers,
    errors_with,
    files_of_pattern,
    is_pattern,
    is_read_by_packages,
    is_volume_folder,
    source_of_file,
    source_of_layers,
    steps_of_file,
)
from .order import natural_order

__all__ = [
    "Index",
    "are_layers",
    "errors_with",
    "files_of_pattern",
    "is_pattern",
    "is_read_by_packages",
    "is_volume_folder",
    "natural_order",
    "parse_index",
    "source_of_file",
    "source_of_layers",
    "steps_of_file",
]
