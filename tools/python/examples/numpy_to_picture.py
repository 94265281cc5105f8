"""From an array to a picture, in four lines.

python numpy_to_picture.py [picture.png]
"""

import sys

import numpy as np

import isowave

z, y, x = np.mgrid[-1:1:96j, -1:1:128j, -1:1:160j]
heart = (x**2 + 2.25 * y**2 + z**2 - 0.36) ** 3 - x**2 * z**3 - 0.1125 * y**2 * z**3

volume = isowave.compress(heart, tolerance=1e-4, spacing=(2 / 95, 2 / 127, 2 / 159))
image = volume.render(isovalue=0, size=(640, 480), color="#b03a48")
image.save(sys.argv[1] if len(sys.argv) > 1 else "heart.png")
print(volume)
print(image, image.statistics)
