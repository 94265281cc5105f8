"""Run by test_bricks.py under mpirun: draws bricks, and finds out what goes wrong."""

import json
import sys

import numpy as np
from mpi4py import MPI

import isowave

comm = MPI.COMM_WORLD
rank, size = comm.Get_rank(), comm.Get_size()
fuel, levelled, folder = sys.argv[1:]

pictures = {}


def keep(name, image):
    assert (image is None) == (rank != 0)
    if image is not None:
        pictures[name + "_rgb"], pictures[name + "_depth"] = image.rgb, image.depth
        pictures[name + "_normals"], pictures[name + "_bounds"] = image.normals, image.bounds
        pictures[name + "_hits"] = image.statistics["hits"]


renderer = isowave.BrickRenderer(fuel, comm, size=(96, 64), samples=2, rays=True, exact=True)
keep("plain", renderer.render(40))
keep("samples", renderer.render(40, samples=2, size=(48, 32), normals="cell"))
keep("ambient", renderer.render(40, ambient_rays=3, color="#3070b0"))
for samples in (1, 2):
    image = renderer.render(40, size=(48, 32), samples=samples, transparent=True)
    if image is not None:
        pictures[f"rgba{samples}"] = image.rgba
camera = isowave.Camera.orbit(renderer, 3)[1]
keep("orbit", renderer.render(90, camera=camera, outputs=("rgb", "depth")))
turned = renderer.turntable(3, 90)[1]
keep("turntable", renderer.render(90, camera=turned, outputs=("rgb", "depth")))
keep("depth", renderer.render(90, outputs=("depth",)))
assert renderer.shape == (32, 33, 64)
assert renderer.device["name"]

finer = isowave.BrickRenderer(levelled, comm, size=(64, 48), levels=True, bricks=(1, 1, size))
keep("levels", finer.render(40, voxel_pixels=1.5))
keep("level", finer.render(40, voxel_error=2.0))

bounded = isowave.BrickRenderer(levelled, comm, size=(64, 48), levels=True, bounds=True)
keep("bounded", bounded.render(40, max_surface_error=0.5, outputs=("rgb", "depth", "bounds")))
rated = isowave.BrickRenderer(fuel, comm, size=(64, 48), bounds=True, rate=8)
keep("rated", rated.render(40, voxel_error=2.0, outputs=("bounds", "depth")))

layered = isowave.BrickRenderer(
    fuel, comm, size=(64, 48), surfaces=2, rays=True, field=fuel, exact=True
)
both = [isowave.Surface(20, "skin", 0.4), isowave.Surface(90, "blue")]
keep("surfaces", layered.render(surfaces=both))
slices = [isowave.Slice("z", 14), isowave.Slice("x", 30, 0.5)]
keep("slices", layered.render(surfaces=both, slices=slices, slice_map="magma", ambient_rays=2))
by_field = isowave.ColorMap(by="field")
image = layered.render(
    90, clip=[isowave.ClipPlane((0, 0, 1), 12)], color_map=by_field, outputs=("rgb", "field")
)
if image is not None:
    pictures["field_rgb"], pictures["field"] = image.rgb, image.field
groups = [isowave.Surface(labels=[90, 91, 92]), isowave.Surface(labels=range(20, 40), opacity=0.4)]
labelled = isowave.BrickRenderer(
    fuel, comm, size=(64, 48), surfaces=2, labels=True, field=fuel, exact=True
)
keep("labels", labelled.render(surfaces=groups, color_map=isowave.ColorMap(by="labels")))


def passes_of(renderer, last=None, **scene):
    """Rank 0's pictures of the passes, up to number `last`, and the frame."""
    seen = []

    def on_pass(progress):
        assert rank == 0 and progress.passes == len(seen) + 1
        seen.append(progress.rgb)
        return len(seen) != last

    return seen, renderer.render(size=(48, 32), samples=1, on_pass=on_pass, **scene)


for name, by, scene in (
    ("one", renderer, {"isovalue": 40}),
    ("layers", layered, {"surfaces": both, "slices": slices, "ambient_rays": 1}),
):
    seen, image = passes_of(by, **scene)
    keep(f"passes of {name}", image)
    stopped, part = passes_of(by, last=1, **scene)
    if image is not None:
        np.testing.assert_array_equal(seen[-1], image.rgb)
        assert (seen[0] != image.rgb).any() and image.statistics["complete"]
        assert len(stopped) == 1 and not part.statistics["complete"]
        assert part.rgb.shape == image.rgb.shape

errors = {}


def fails(name, work):
    """All processes must raise; their messages, by rank."""
    text = None
    try:
        work()
    except (isowave.Error, TypeError, ValueError) as error:
        text = str(error)
    errors[name] = comm.allgather(text)


fails("surfaces", lambda: renderer.render(surfaces=both))
fails("labels", lambda: layered.render(surfaces=groups))
fails("field", lambda: renderer.render(40, color_map=by_field))
fails("no field", lambda: isowave.BrickRenderer(fuel, comm, size=(8, 8), field=folder))
bounced = isowave.BrickRenderer(fuel, comm, size=(64, 48), bounce=True, exact=True)
keep("bounce", bounced.render(40, bounce_rays=4, light=(1, 1, 0.5)))
fails("bounce", lambda: renderer.render(40, bounce_rays=4, light=(0, 0, 1)))
fails("neither", lambda: renderer.render())
fails("isovalue", lambda: renderer.render(40 + rank))
fails("auto", lambda: renderer.render("auto"))
fails("auto camera", lambda: renderer.camera("auto"))
fails("turntable", lambda: renderer.turntable(0 if rank == 1 else 3, 90))
fails("camera", lambda: renderer.render(40, camera=camera if rank == 1 else None))
fails("color", lambda: renderer.render(40, color="bluish" if rank == 1 else None))
fails("transparent", lambda: renderer.render(40, transparent=rank == 1))
fails("outputs", lambda: renderer.render(40, outputs=("position",)))
fails("in on_pass", lambda: renderer.render(40, on_pass=lambda progress: progress.rgba))
fails("answer", lambda: renderer.render(40, on_pass=lambda progress: "yes"))
fails("one on_pass", lambda: renderer.render(40, on_pass=print if rank == 1 else None))
fails("time", lambda: renderer.render(40, time_budget_ms=1000))
fails("max_surface_error", lambda: renderer.render(40, max_surface_error=1.0))
fails("no error", lambda: bounded.render(40, max_surface_error=0.0))
fails("too large", lambda: renderer.render(40, size=(960, 640)))
fails("levels", lambda: isowave.BrickRenderer(fuel, comm, size=(8, 8), levels=True))
fails("compressed", lambda: isowave.BrickRenderer(levelled, comm, size=(8, 8), rate=8))
fails("missing", lambda: isowave.BrickRenderer(f"{folder}/{rank}.zfp", comm, size=(8, 8)))
fails("volume", lambda: isowave.BrickRenderer((levelled, fuel)[rank == 1], comm, size=(8, 8)))
fails("bricks", lambda: isowave.BrickRenderer(fuel, comm, size=(8, 8), bricks=(2, 2, 2)))
keep("again", renderer.render(40))

if rank == 0:
    np.savez(f"{folder}/pictures.npz", **{k: v for k, v in pictures.items() if v is not None})
    with open(f"{folder}/errors.json", "w") as file:
        json.dump(errors, file)
