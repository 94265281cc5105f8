"""Compares two isovalues, and says how far compression may have moved each surface.

python two_isovalues.py VOLUME ISOVALUE ISOVALUE [picture.png]
"""

import sys

import numpy as np

import isowave

path, isovalues = sys.argv[1], [float(text) for text in sys.argv[2:4]]
volume = isowave.open(path, tolerance=0.5)
renderer = volume.renderer(size=(480, 360), bounds=True)
camera = renderer.camera(min(isovalues))  # one view for both

images = []
for isovalue in isovalues:
    image = renderer.render(isovalue, camera=camera, outputs=("rgb", "depth", "bounds"))
    hit = np.isfinite(image.depth)
    bounds = image.bounds[hit]
    print(
        f"isovalue {isovalue:g}: {hit.mean():.1%} of the pixels; of these, "
        f"{np.mean(bounds <= 1):.1%} are certainly within a pixel of the surface before compression"
    )
    images.append(image)

behind = np.isfinite(images[0].depth) & np.isfinite(images[1].depth)
if behind.any():
    apart = np.abs(images[1].depth[behind] - images[0].depth[behind])
    print(f"where both are seen, they are {np.median(apart):.3g} world units apart in the median")

rgb = np.hstack([image.rgb for image in images])
if len(sys.argv) > 4:
    from PIL import Image

    Image.fromarray(rgb).save(sys.argv[4])
