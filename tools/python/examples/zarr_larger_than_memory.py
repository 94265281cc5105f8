"""Compresses an array that is in a chunked store, a few layers at a time.

    python zarr_larger_than_memory.py FOLDER [EDGE]

Makes a zarr array of EDGE^3 voxels (default 256) in the folder, as a simulation would, and
compresses it into a .zfp file beside it. Neither is ever in memory whole, whatever EDGE is.
"""

import pathlib
import sys

import numpy as np
import zarr

import isowave

folder = pathlib.Path(sys.argv[1])
edge = int(sys.argv[2]) if len(sys.argv) > 2 else 256

store = zarr.open_array(
    folder / "waves.zarr", mode="w", shape=(edge,) * 3, chunks=(32, 64, 64), dtype="uint8"
)
y, x = np.ogrid[0:edge, 0:edge]
for begin in range(0, edge, 32):
    z = np.arange(begin, min(begin + 32, edge))[:, None, None]
    waves = np.sin(0.11 * x) + np.sin(0.07 * y + 0.05 * z) + np.cos(0.09 * z)
    store[begin : begin + 32] = np.rint(42 * (waves + 3)).astype("uint8")

volume = isowave.compress(store, tolerance=1, path=folder / "waves.zfp")
print(volume)

image = volume.render(isovalue=150, size=(640, 480))
image.save(folder / "waves.png")
