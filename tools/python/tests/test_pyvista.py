"""isowave.pyvista: the isosurface among meshes whose places are known, drawn by VTK off the screen.

The volume holds distances from the origin: its isosurface at R is a sphere of radius R.
"""

import math
import warnings

import numpy as np
import pytest

import isowave

pyvista = pytest.importorskip("pyvista")
adapter = pytest.importorskip("isowave.pyvista")

from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: E402
from vtkmodules.vtkCommonCore import vtkFloatArray  # noqa: E402

H = 0.1  # between voxels
RADIUS = 1.0
TOLERANCE = 1e-4  # of compression
SIZE = (160, 120)
GREY, RED = (0.8, 0.8, 0.8), "#ff0000"


def image_data():
    image = pyvista.ImageData(dimensions=(41, 37, 33), spacing=(H,) * 3, origin=(-2.0, -1.8, -1.6))
    image["distance"] = np.linalg.norm(image.points, axis=1).astype(np.float32)
    return image


@pytest.fixture(scope="module")
def volume():
    return isowave.compress(image_data(), tolerance=TOLERANCE)


@pytest.fixture
def plotter():
    plotter = pyvista.Plotter(off_screen=True, window_size=SIZE)
    plotter.background_color = "white"
    plotter.camera.position, plotter.camera.focal_point = (0, 0, 6), (0, 0, 0)
    plotter.camera.up, plotter.camera.view_angle = (0, 1, 0), 30
    plotter.renderer.camera_set = True
    yield plotter
    plotter.close()


def pixel_of(plotter, point):
    """Row and column that show a point, by the camera's definition rather than VTK's matrices."""
    camera = plotter.camera
    eye, at = np.array(camera.position), np.array(camera.focal_point)
    forward = (at - eye) / np.linalg.norm(at - eye)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    offset = np.array(point, float) - eye
    half = np.tan(np.radians(camera.view_angle) / 2) * (offset @ forward)
    x, y = offset @ right / half, offset @ np.cross(right, forward) / half
    width, height = plotter.window_size
    return int((1 - y) / 2 * height), int((x * height + width) / 2)


def is_red(rgb):
    """The mesh, in whatever light; the isosurface is grey, the background white."""
    return (rgb[..., 1] < 40) & (rgb[..., 0] > 60)


def is_grey(rgb):
    spread = rgb.max(-1).astype(int) - rgb.min(-1)
    return (spread <= 2) & (rgb.max(-1) < 250)


def add_ball(plotter, center, radius=0.3, **options):
    mesh = pyvista.Sphere(radius=radius, center=center, theta_resolution=60, phi_resolution=60)
    return plotter.add_mesh(mesh, color=RED, ambient=0.5, **options)


def test_meshes_hide_the_surface_and_it_them(plotter, volume):
    adapter.add_isosurface(plotter, volume, RADIUS, color=GREY)
    add_ball(plotter, (0.4, 0, 1.5))  # before the surface
    add_ball(plotter, (-0.4, 0, -1.5))  # behind it
    add_ball(plotter, (0, 1.0, 0), radius=0.4)  # half in it
    rgb = adapter.screenshot(plotter)
    assert rgb.shape == (*SIZE[::-1], 3)
    assert is_red(rgb[pixel_of(plotter, (0.4, 0, 1.8))])
    assert is_grey(rgb[pixel_of(plotter, (-0.4, 0, -1.5))])
    assert is_grey(rgb[pixel_of(plotter, (0, 0.8, 0.59))])  # a ray that meets the surface first
    assert is_red(rgb[pixel_of(plotter, (0, 1.3, 0))])
    assert (rgb[0, 0] == 255).all()


@pytest.mark.parametrize(("eye", "is_before"), [((2, 1.5, 5.5), True), ((-4, 1.5, 3.5), False)])
def test_each_pixel_shows_what_is_nearer(plotter, volume, eye, is_before):
    """Against the closed form of both spheres; pixels within rounding of an edge do not count."""
    surface = adapter.add_isosurface(plotter, volume, RADIUS, color=GREY)
    centre, radius = np.array([0.7, 0.3, 0.5]), 0.6
    add_ball(plotter, centre, radius)
    plotter.camera.position = eye
    rgb = adapter.screenshot(plotter)
    camera = surface.image.camera
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    forward = -np.array(camera.eye) / np.linalg.norm(camera.eye)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    pixel = 2 * np.tan(np.radians(15)) / SIZE[1]
    x, y = (columns + 0.5 - SIZE[0] / 2) * pixel, (SIZE[1] / 2 - rows - 0.5) * pixel
    rays = forward + x[..., None] * right + y[..., None] * np.cross(right, forward)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)

    def nearest(middle, r):
        to = middle - np.array(camera.eye)
        along = rays @ to
        inside = r**2 - (to @ to - along**2)
        return np.where(inside > 0, along - np.sqrt(np.maximum(inside, 0)), np.inf), inside

    ours, our_inside = nearest(np.zeros(3), RADIUS)
    theirs, their_inside = nearest(centre, radius)
    # Both are off the spheres: the mesh of 60 x 60 by at most r (1 - cos(pi / 60)) along two axes,
    # the surface by shell(). Where the two differ by more along the ray, or a ray passes an edge
    # by more than half a pixel and that, no doubt is left. Grazing rays stretch it: below 60
    # degrees of incidence by 2 at most.
    off = 2 * radius * (1 - np.cos(np.pi / 60)) + shell()
    width = off + 6.2 * pixel
    clear = (np.abs(our_inside) > 2 * RADIUS * width) & (np.abs(their_inside) > 2 * radius * width)
    both = np.isfinite(ours) & np.isfinite(theirs)
    steep = (our_inside > (RADIUS / 2) ** 2) & (their_inside > (radius / 2) ** 2)
    with np.errstate(invalid="ignore"):
        clear &= ~both | (steep & (np.abs(ours - theirs) > 2 * off))
    red, grey = theirs < ours, ours < theirs
    assert (clear & both & (red if is_before else grey)).sum() > 100
    assert is_red(rgb)[clear & red].all() and is_grey(rgb)[clear & grey].all()
    assert not (is_red(rgb) | is_grey(rgb))[clear & ~np.isfinite(np.minimum(ours, theirs))].any()


def shell():
    """How far the trilinear surface may be from the sphere.

    Interpolation of f is off by at most h^2/8 (|f_xx| + |f_yy| + |f_zz|) = h^2/8 * 2/r, r being the
    least radius in a cell that the surface crosses; f grows by 1 per unit.
    """
    return H**2 / 8 * 2 / (RADIUS - np.sqrt(3) * H) + TOLERANCE


def buffered_depth(plotter, near, far):
    """The depth buffer as distance from the eye's plane; inf where nothing is."""
    width, height = plotter.window_size
    values = vtkFloatArray()
    plotter.render_window.GetZbufferData(0, 0, width - 1, height - 1, values)
    depth = vtk_to_numpy(values).reshape(height, width)[::-1].astype(float)
    with np.errstate(divide="ignore"):
        return np.where(depth < 1, far * near / (far - (far - near) * depth), np.inf)


def test_depth_is_that_of_contour(plotter, volume):
    """The depth buffer with our surface, and with VTK's contour of the same data."""
    plotter.render_window.SetMultiSamples(0)
    plotter.camera.position = (3, 2, 4)
    near, far = plotter.camera.clipping_range = (2, 10)
    surface = adapter.add_isosurface(plotter, volume, RADIUS)
    adapter.screenshot(plotter)
    ours, exact = buffered_depth(plotter, near, far), adapter.eye_depth(surface.image)
    surface.remove()
    contour = image_data().contour([RADIUS], scalars="distance")
    plotter.add_mesh(contour, show_scalar_bar=False)
    plotter.camera.clipping_range = (near, far)
    plotter.render()
    theirs = buffered_depth(plotter, near, far)

    # The buffer has steps of 2^-24, or float32's rounding; the shader rounds five times to float32
    # (texture, quotient, difference, half, sum) numbers of at most 2 far / (far - near). Each may
    # be off by 2^-24 of that; a division in OpenGL by 2.5 units, which are 2^-23 each.
    rounding = (1 + (4 + 5) * 2 * far / (far - near)) * 2.0**-24
    hit = np.isfinite(ours)
    step = rounding * exact[hit].max() ** 2 * (far - near) / (far * near)
    assert hit.sum() > 1000 and (hit == np.isfinite(exact)).all()
    assert np.abs(ours[hit] - exact[hit]).max() <= step

    # Corners of the contour's triangles are within shell() of the sphere. Their edges are at most
    # sqrt(3) h long, so no point between them is farther than h from the nearest corner, or more
    # than h^2 / (2 r) below the sphere. Rays that meet it at less than 60 degrees from its normal
    # stretch all that by 2.
    eye = np.array(surface.image.camera.eye)
    distance = surface.image.depth
    steep = hit & np.isfinite(theirs)
    cosine = (eye @ eye - RADIUS**2 - distance[steep] ** 2) / (2 * RADIUS * distance[steep])
    steep[steep] = cosine > 0.5 + 0.05
    assert steep.sum() > 500
    allowed = 2 * (2 * shell() + H**2 / (2 * (RADIUS - shell()))) + step
    assert np.abs(ours[steep] - theirs[steep]).max() <= allowed
    assert (hit ^ np.isfinite(theirs)).sum() <= 0.1 * hit.sum()  # the rims


def test_camera_moves(plotter, volume):
    """The picture follows the plotter's camera, its size, and clipping planes; and only these."""
    surface = adapter.add_isosurface(plotter, volume, RADIUS, color=GREY)
    first = adapter.screenshot(plotter)
    image = surface.image
    assert (adapter.screenshot(plotter) == first).all() and surface.image is image
    plotter.camera.clipping_range = (1, 50)
    assert (adapter.screenshot(plotter) == first).all() and surface.image is image
    plotter.camera.clipping_range = (5.5, 50)  # before the far half alone: the near one is hidden
    assert not is_grey(adapter.screenshot(plotter))[SIZE[1] // 2, SIZE[0] // 2]
    plotter.camera.clipping_range = (1, 50)

    plotter.camera.position, plotter.camera.focal_point = (0, -6, 1), (0.9, 0, 0)
    plotter.camera.up = (0, 0, 1)
    rgb = adapter.screenshot(plotter)
    assert surface.image is not image
    inside, outside = [
        [
            sign * scale * RADIUS * np.array(axis)
            for axis in ((1, 0, 0), (0, 0, 1))
            for sign in (1, -1)
        ]
        for scale in (0.9, 1.1)
    ]
    assert all(is_grey(rgb[pixel_of(plotter, point)]) for point in inside)
    assert not any(is_grey(rgb[pixel_of(plotter, point)]) for point in outside)

    plotter.window_size = (90, 150)
    rgb = adapter.screenshot(plotter)
    assert rgb.shape == (150, 90, 3) and surface.image.depth.shape == (150, 90)
    assert all(is_grey(rgb[pixel_of(plotter, point)]) for point in inside[2:])


def test_picture_is_that_of_render(plotter, volume):
    surface = adapter.add_isosurface(plotter, volume, RADIUS, color=GREY)
    rgb = adapter.screenshot(plotter)
    hit = np.isfinite(surface.image.depth)
    alone = volume.render(RADIUS, size=SIZE, camera=surface.image.camera, color=GREY)
    assert (alone.depth == surface.image.depth).all()
    # VTK smooths edges by several samples of a pixel: only if all eight neighbours are hit.
    inner = hit.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            inner &= np.roll(inner, step, axis)
    assert inner.sum() > 1000 and (rgb[inner] == alone.rgb[inner]).all()
    assert np.allclose(surface.image.camera.eye, (0, 0, 6))
    assert isowave.Camera.from_pyvista(plotter.camera).fovy == pytest.approx(
        surface.image.camera.fovy
    )


def test_enlarged_screenshot(plotter, volume):
    """VTK draws it in tiles; it shows what a window of that size does."""
    adapter.add_isosurface(plotter, volume, RADIUS, color=GREY)
    add_ball(plotter, (0.6, 0, 0.7))
    enlarged = adapter.screenshot(plotter, scale=2)
    plotter.window_size = (2 * SIZE[0], 2 * SIZE[1])
    whole = adapter.screenshot(plotter)
    assert enlarged.shape == whole.shape
    for kind in (is_red, is_grey):
        differ = kind(enlarged) != kind(whole)
        edges = sum(np.abs(np.diff(kind(whole).astype(int), axis=axis)).sum() for axis in (0, 1))
        assert kind(whole).sum() > 1000 and differ.sum() <= edges


def test_handle(plotter, volume):
    add_ball(plotter, (0, 0, 0), radius=0.5)
    surface = adapter.add_isosurface(plotter, volume, RADIUS, color=GREY)
    other = adapter.add_isosurface(plotter, volume, 0.3, color=GREY)  # within the ball
    middle = (SIZE[1] // 2, SIZE[0] // 2)
    assert is_grey(adapter.screenshot(plotter)[middle])
    surface.isovalue = 0.4
    assert is_red(adapter.screenshot(plotter)[middle])
    surface.isovalue, surface.color = 0.6, (0, 0, 1)
    red, green, blue = adapter.screenshot(plotter)[middle]
    assert blue > 100 > max(red, green)
    surface.visible = False
    assert is_red(adapter.screenshot(plotter)[middle])
    surface.visible = True
    surface.remove()
    surface.remove()
    assert is_red(adapter.screenshot(plotter)[middle])
    assert not plotter.renderer.HasViewProp(surface.actor)
    other.remove()
    assert len(plotter.renderer.actors) == 1


def test_clipping_planes_may_move(plotter, volume):
    """The front half of the surface hides a ball within, until a plane takes it away."""
    add_ball(plotter, (0, 0, 0), radius=0.5)
    surface = adapter.add_isosurface(plotter, volume, RADIUS, color=GREY, caps=False)
    middle = (SIZE[1] // 2, SIZE[0] // 2)
    assert is_grey(adapter.screenshot(plotter)[middle])
    surface.clip = [isowave.ClipPlane.through((0, 0, 0.6), (0, 0, -1))]
    rgb = adapter.screenshot(plotter)
    assert is_red(rgb[middle]) and is_grey(rgb[pixel_of(plotter, (0.7, 0, 0.6))])
    surface.clip[0] = isowave.ClipPlane.through((0, 0, 0), (0, 0, 1))
    assert is_grey(adapter.screenshot(plotter)[middle])


def test_scene_knows_the_volume(volume):
    """Its box is among the scene's bounds, so that a plotter's first camera sees it."""
    plotter = pyvista.Plotter(off_screen=True, window_size=SIZE)
    adapter.add_isosurface(plotter, volume, RADIUS, color=GREY)
    assert np.allclose(plotter.bounds, (-2, 2, -1.8, 1.8, -1.6, 1.6), atol=1e-6)
    rgb = adapter.screenshot(plotter)
    assert is_grey(rgb[SIZE[1] // 2, SIZE[0] // 2]) and not is_grey(rgb[:, 0]).any()
    plotter.close()


def test_two_scenes(volume):
    plotter = pyvista.Plotter(off_screen=True, window_size=(200, 100), shape=(1, 2))
    adapter.add_isosurface(plotter, volume, RADIUS, color=GREY)
    plotter.subplot(0, 1)
    surface = adapter.add_isosurface(plotter, volume, RADIUS, color=RED)
    rgb = adapter.screenshot(plotter)
    assert surface.image.depth.shape == (100, 100)
    assert is_grey(rgb[50, 50]) and rgb[50, 150, 0] > 2 * int(rgb[50, 150, 1])
    with pytest.raises(ValueError, match="enlarged"):
        adapter.screenshot(plotter, scale=2)
    plotter.close()


def test_translucent_mesh_is_blended_over_it(plotter, volume):
    adapter.add_isosurface(plotter, volume, RADIUS, color=(0, 0, 1))
    add_ball(plotter, (0, 0, 1.5), opacity=0.5)
    red, _, blue = adapter.screenshot(plotter)[SIZE[1] // 2, SIZE[0] // 2]
    assert red > 60 and blue > 60


def test_parallel_projection(plotter, volume):
    """The surface covers what a mesh of it covers, and hides what is behind it."""
    surface = adapter.add_isosurface(plotter, volume, RADIUS, color=GREY)
    plotter.enable_parallel_projection()
    shown = is_grey(adapter.screenshot(plotter))
    assert surface.error is None
    view = isowave.Camera.from_pyvista(plotter.camera)
    assert view.parallel_height == 2 * plotter.camera.parallel_scale
    pixel = view.pixel_size(SIZE[1], 1)
    radius = math.sqrt(shown.sum() / math.pi) * pixel
    assert radius == pytest.approx(RADIUS, rel=0.03)
    add_ball(plotter, (0, 0, -0.5 * RADIUS), radius=0.2 * RADIUS)
    assert (is_grey(adapter.screenshot(plotter)) == shown).all()
    near = np.array(plotter.camera.position)
    near *= 1.2 * RADIUS / np.linalg.norm(near)
    add_ball(plotter, tuple(near), radius=0.2 * RADIUS)
    assert is_grey(adapter.screenshot(plotter)).sum() < shown.sum()
    plotter.disable_parallel_projection()
    assert is_grey(adapter.screenshot(plotter)).any()


def test_what_cannot_be_drawn(plotter, volume):
    with pytest.raises(ValueError, match="there is no colour 'reddish'"):
        adapter.add_isosurface(plotter, volume, RADIUS, color="reddish")
    with pytest.raises(ValueError, match="normals"):
        adapter.add_isosurface(plotter, volume, RADIUS, normals="none")
    adapter.add_isosurface(plotter, volume, RADIUS, device="no such device")
    with pytest.raises(isowave.Error, match="no such device"):
        adapter.screenshot(plotter)


def test_max_surface_error(plotter, volume):
    surface = adapter.add_isosurface(plotter, volume, RADIUS, color=GREY, max_surface_error=1)
    assert is_grey(adapter.screenshot(plotter)).any() and surface.image.complete


def test_scaled_scene_is_refused(plotter, volume):
    adapter.add_isosurface(plotter, volume, RADIUS, color=GREY)
    plotter.set_scale(zscale=2, reset_camera=False, render=False)
    with pytest.raises(ValueError, match="scaled"):
        adapter.screenshot(plotter)


def test_volume_with_directions(plotter):
    """A blob where only spacing, origin and directions together put it."""
    voxels = np.zeros((12, 16, 20), np.float32)
    voxels[4:7, 9:12, 13:16] = 1  # around (5, 10, 14)
    turned = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], float)
    grid = {"spacing": (0.1, 0.2, 0.05), "origin": (0.5, 0.4, -0.3), "direction": turned}
    volume = isowave.compress(voxels, tolerance=TOLERANCE, **grid)
    blob = np.array([-0.3, 0.4, 0.5]) + turned @ (np.array([0.05, 0.2, 0.1]) * (14, 10, 5))
    surface = adapter.add_isosurface(plotter, volume, 0.5, color=GREY)
    plotter.camera.focal_point, plotter.camera.position = (0, 0, 0), (3, 2, 5)
    rgb = adapter.screenshot(plotter)
    row, column = pixel_of(plotter, blob)
    assert is_grey(rgb[row, column])
    # The blob is a box that has rounded corners and sides of at most 0.6.
    distance = np.linalg.norm(blob - np.array(plotter.camera.position))
    assert abs(surface.image.depth[row, column] - distance) < 0.3 * np.sqrt(3)
    low, high = np.array(surface.actor.GetBounds()).reshape(3, 2).T
    corner = np.array([-0.3, 0.4, 0.5]) + turned @ (np.array([0.05, 0.2, 0.1]) * (19, 15, 11))
    assert np.allclose(np.sort([low, high], 0), np.sort([[-0.3, 0.4, 0.5], corner], 0), atol=1e-6)
