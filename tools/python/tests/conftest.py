"""What tests of several files share."""

import os
import pathlib
import subprocess

import numpy as np
import pytest

import isowave

TOP = pathlib.Path(__file__).resolve().parents[3]
FUEL = TOP / "tests/data/fuel_64x33x32_uint8.raw.gz"

# Most tests look at what devices do. Without a name, the host would draw if there is no GPU.
os.environ.setdefault("ISOWAVE_DEVICE", "cpu")


@pytest.fixture(scope="session")
def program():
    """Runs the program of the build, not that of the wheel."""
    path = os.environ.get("ISOWAVE_PROGRAM")
    if not path:
        pytest.skip("ISOWAVE_PROGRAM does not name the program")

    def run(*arguments):
        done = subprocess.run(
            [path, *map(str, arguments)], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def sphere_voxels(shape=(20, 25, 30), dtype=np.float32):
    """Distance from the middle, in voxels along each axis alike; unequal sides."""
    z, y, x = np.ogrid[tuple(slice(0, n) for n in shape)]
    middle = [(n - 1) / 2 for n in shape]
    return np.sqrt((z - middle[0]) ** 2 + (y - middle[1]) ** 2 + (x - middle[2]) ** 2).astype(dtype)


@pytest.fixture(scope="module")
def volume():
    return isowave.compress(sphere_voxels(), tolerance=0.01, spacing=(3, 2, 1), origin=(30, 20, 10))


class RecordingCore:
    """A volume's compiled part that notes how many blocks of 4 x 4 x 4 voxels each call decodes."""

    def __init__(self, core):
        self._core, self.blocks = core, []

    def __getattr__(self, name):
        return getattr(self._core, name)

    def decode(self, level, begin, end, step):
        sides = [len({i // 4 for i in range(*axis)}) for axis in zip(begin, end, step)]
        self.blocks.append(sides[0] * sides[1] * sides[2])
        return self._core.decode(level, begin, end, step)
