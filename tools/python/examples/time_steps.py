"""A batch of time steps: one picture each, all from the same camera.

python time_steps.py FOLDER [STEPS]
"""

import pathlib
import sys

import numpy as np

import isowave

folder = pathlib.Path(sys.argv[1])
num_steps = int(sys.argv[2]) if len(sys.argv) > 2 else 4
z, y, x = np.mgrid[-2:2:64j, -2:2:64j, -2:2:64j].astype(np.float32)


def step(time: float) -> np.ndarray:
    """Two drops that become one."""
    apart = 1.2 * (1 - time)
    left = np.exp(-2 * ((x - apart) ** 2 + y**2 + z**2))
    return left + np.exp(-2 * ((x + apart) ** 2 + y**2 + z**2))


camera = None
for i in range(num_steps):
    volume = isowave.compress(
        step(i / max(num_steps - 1, 1)), tolerance_relative=1e-3, spacing=(4 / 63,) * 3
    )
    if camera is None:
        camera = volume.camera(0.4, size=(320, 240))
    image = volume.render(0.4, size=(320, 240), camera=camera)
    image.save(folder / f"step_{i:03}.png")
    print(f"step {i}: {volume.bits_per_voxel:.2f} bits a voxel, {image.statistics['hits']} hits")
