"""Voxels to compare with, and what a source made of an array must say."""

import weakref

import numpy as np
import pytest

from isowave._arrays import ArraySource, as_source


NZ, NY, NX = 7, 5, 3


SPACING = (3.0, 0.5, 2.0)  # z, y, x


ORIGIN = (10.0, -20.0, 30.0)  # z, y, x


SLABS = (4, 5, 32, None)  # None: all layers at once


def make_voxels(dtype="int16", shape=(NZ, NY, NX), seed=0):
    rng = np.random.default_rng(seed)
    kind = np.dtype(dtype).kind
    if kind == "b":
        return rng.integers(0, 2, shape).astype(bool)
    if kind == "f":
        return rng.normal(size=shape).astype(dtype)
    return rng.integers(-100 if kind == "i" else 0, 100, shape).astype(dtype)


def make_direction():
    """A rotation about no axis of the world."""
    rotation, _ = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))
    return rotation


def read_all(source, layers=None):
    layers = layers or source.shape[0]
    slabs = []
    for begin in range(0, source.shape[0], layers):
        slab = source.read(begin, min(begin + layers, source.shape[0]))
        assert slab.flags.c_contiguous and slab.dtype == source.dtype
        assert slab.dtype.isnative
        slabs.append(slab)
    return np.concatenate(slabs)


def world(source, z, y, x):
    """Position (x, y, z) of a voxel, by the definition that python users read."""
    step = np.array(source.spacing[::-1]) * np.array([x, y, z], dtype=float)
    return np.array(source.origin[::-1]) + source.direction @ step


def check_source(source, expected, **grid):
    """Voxels equal, whatever slabs they come in, and a grid as given, else the unit one."""
    assert isinstance(source, ArraySource)
    assert source.shape == expected.shape
    for layers in SLABS:
        np.testing.assert_array_equal(read_all(source, layers), expected)
    assert source.spacing == grid.get("spacing", (1.0, 1.0, 1.0))
    assert source.origin == grid.get("origin", (0.0, 0.0, 0.0))
    np.testing.assert_array_equal(source.direction, grid.get("direction", np.eye(3)))
    assert not source.direction.flags.writeable


def check_refused(obj, *texts, error=ValueError, read=False, **options):
    """One line of that type, with all of these texts."""
    with pytest.raises(error) as caught:
        source = as_source(obj, **options)
        if read:
            read_all(source)
    message = str(caught.value)
    assert "\n" not in message and len(message) < 500
    for text in texts:
        assert text in message


# numpy ------------------------------------------------------------------------------------------

KEPT = ["uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64"]


KEPT += ["uint64", "int64"]


READ_AS = {"bool": "uint8", "float16": "float32"}


def zarr_counting_store(zarr):
    class Counting(zarr.storage.MemoryStore):
        counts = {}  # of the class: zarr makes a read-only twin of its store

        async def get(self, key, *args, **kwargs):
            self.counts[key] = self.counts.get(key, 0) + 1
            return await super().get(key, *args, **kwargs)

    return Counting()


class CountingChunks:
    """Stands for a zarr array in memory: counts how often each chunk is fetched, and how many
    bytes of what it gave are alive."""

    __module__ = "zarr.core.array"

    def __init__(self, voxels, chunk_layers):
        self.voxels = voxels
        self.shape, self.dtype = voxels.shape, voxels.dtype
        self.chunks = (chunk_layers, 2, 2)
        self.fetched = [0] * -(-self.shape[0] // chunk_layers)
        self.alive = self.most_alive = 0

    def __getitem__(self, layers):
        begin, end = layers.start, layers.stop
        for row in range(begin // self.chunks[0], -(-end // self.chunks[0])):
            self.fetched[row] += 1
        result = self.voxels[begin:end].copy()
        self.alive += result.nbytes
        self.most_alive = max(self.most_alive, self.alive)
        weakref.finalize(result, self.release, result.nbytes)
        return result

    def release(self, num_bytes):
        self.alive -= num_bytes


CountingChunks.__name__ = "Array"
