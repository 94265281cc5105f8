"""Volume.extract: meshes without cracks, equal to VTK's on the decoded voxels."""

import os
import pathlib
import re

import numpy as np
import pytest

import isowave


def noise(shape, seed, values=None):
    random = np.random.default_rng(seed)
    if values is not None:
        return random.integers(0, values, shape).astype(np.float32)
    return random.normal(size=shape).astype(np.float32)


def expect_closed(mesh, last):
    """Each edge has another triangle the other way round, unless it lies in the border."""
    edges = np.concatenate([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)]).astype(np.int64)
    keys = edges[:, 0] << 32 | edges[:, 1]
    assert len(np.unique(keys)) == len(keys)
    is_open = ~np.isin(edges[:, 1] << 32 | edges[:, 0], keys)
    a, b = (mesh.vertices[edges[is_open, i]] for i in range(2))
    in_border = ((a == b) & ((a == 0) | (a == np.asarray(last)))).any(axis=1)
    assert in_border.all()
    assert len(np.unique(mesh.faces)) == len(mesh.vertices)


def with_vtk(pipeline, voxels, isovalue):
    """Vertices and number of triangles by a filter of VTK's."""
    from vtkmodules import vtkFiltersCore
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkImageData

    image = vtkImageData()
    image.SetDimensions(*voxels.shape[::-1])
    image.GetPointData().SetScalars(numpy_to_vtk(voxels.ravel(), deep=True))
    contour = getattr(vtkFiltersCore, pipeline)()
    contour.SetInputData(image)
    contour.SetValue(0, isovalue)
    contour.Update()
    result = contour.GetOutput()
    return vtk_to_numpy(result.GetPoints().GetData()), result.GetNumberOfCells()


CASES = [
    (noise((9, 10, 11), 1), 0.1),
    (noise((17, 5, 33), 2), -0.5),
    (noise((24, 25, 26), 3), 0.0),
    (noise((13, 14, 15), 4, values=5), 2.0),  # voxels on the surface
    (noise((16, 16, 16), 5, values=5), 2.5),
]


@pytest.mark.parametrize("array, isovalue", CASES)
def test_mesh_is_that_of_vtk(array, isovalue):
    pytest.importorskip("vtkmodules")
    exact = {"exact": True} if (array == array.round()).all() else {"rate": 16}
    volume = isowave.compress(array.astype(np.uint8) if "exact" in exact else array, **exact)
    expect_mesh_of_vtk(volume, isovalue)


def real_volumes():
    """Volumes of the folder that ISOWAVE_TEST_VOLUMES names, such as one of Open SciVis sets."""
    folder = os.environ.get("ISOWAVE_TEST_VOLUMES")
    found = sorted(pathlib.Path(folder).iterdir()) if folder else []
    says_dims = r"(_\d+x\d+x\d+_\w+\.raw(\.gz)?|\.mha|\.nrrd)$"
    return [path for path in found if re.search(says_dims, path.name)]


@pytest.mark.skipif(not real_volumes(), reason="ISOWAVE_TEST_VOLUMES names no folder of volumes")
@pytest.mark.parametrize("path", real_volumes(), ids=lambda path: path.name)
def test_meshes_of_real_volumes_are_those_of_vtk(path):
    """At seeded isovalues among the middle 80 % of the voxels' range."""
    pytest.importorskip("vtkmodules")
    voxels = isowave.open(str(path), rate=16).decode()
    volume = isowave.compress(voxels, rate=16)  # a grid without spacing, origin and direction
    low, high = float(voxels.min()), float(voxels.max())
    random = np.random.default_rng(len(path.name))
    for isovalue in random.uniform(0.9 * low + 0.1 * high, 0.1 * low + 0.9 * high, 3):
        expect_mesh_of_vtk(volume, float(np.float32(isovalue)))


def expect_mesh_of_vtk(volume, isovalue):
    voxels = volume.decode()
    mesh = volume.extract(isovalue, vertices="exact")
    vertices, num_triangles = with_vtk("vtkFlyingEdges3D", voxels, isovalue)
    assert len(mesh.faces) == num_triangles
    assert len(mesh.vertices) == len(vertices)
    if num_triangles == 0:
        return
    # A crossing is a quotient of differences, each rounded to float32; of places below 2^6, float32
    # has steps of 2^-18.
    tolerance = 2.0 ** (np.ceil(np.log2(max(voxels.shape))) - 23)

    def by_edge(points):
        """The edges that points are on, as numbers, and how far they are from voxels."""
        off = np.abs(points - points.round())
        along = np.arange(3) == off.argmax(axis=1)[:, None]
        lower = np.where(along, np.floor(points), points.round()).astype(np.int64)
        return (lower << np.array([0, 16, 32])).sum(axis=1) * 4 + off.argmax(axis=1), off.max(
            axis=1
        )

    (ours, from_voxel), (theirs, _) = by_edge(mesh.vertices), by_edge(vertices)
    assert (from_voxel[~np.isin(ours, theirs)] <= 2 * tolerance).all()
    _, i, j = np.intersect1d(ours, theirs, return_indices=True)
    assert len(i) > len(ours) / 3
    assert np.abs(mesh.vertices[i] - vertices[j]).max() <= tolerance
    expect_closed(mesh, np.array(voxels.shape[::-1]) - 1)


def test_budget_level_and_normals():
    z, y, x = np.mgrid[:40, :36, :38].astype(np.float32)
    volume = isowave.compress(
        np.sqrt((x - 18) ** 2 + (y - 18) ** 2 + (z - 20) ** 2), tolerance=1e-4, levels=2
    )
    mesh = volume.extract(12)
    assert mesh.vertices.dtype == np.float32 and mesh.faces.dtype == np.uint32
    assert mesh.vertices.shape == mesh.normals.shape
    outwards = mesh.vertices - np.array([18, 18, 20])
    radius = np.linalg.norm(outwards, axis=1)
    assert np.abs(radius - 12).max() < 1 / (8 * 12) + 1e-3  # a chord of a voxel bends by so much
    # Values grow outwards, and normals point away from larger ones.
    assert ((outwards / radius[:, None] * mesh.normals).sum(axis=1) < -0.99).all()
    assert len(mesh.vertices) - 3 * len(mesh.faces) // 2 + len(mesh.faces) == 2  # a sphere

    bounded = volume.extract(12, memory_budget=500_000)
    np.testing.assert_array_equal(bounded.vertices, mesh.vertices)
    np.testing.assert_array_equal(bounded.faces, mesh.faces)
    assert volume.extract(12, normals=False).normals is None
    coarse = volume.extract(12, level=1)
    assert 0 < len(coarse.faces) < len(mesh.faces) / 2


def test_closed_meshes_and_their_largest_parts():
    x, y, z = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in (30, 20, 24)), indexing="ij")
    balls = np.minimum(
        np.sqrt((x - 2) ** 2 + (y - 9) ** 2 + (z - 11) ** 2),
        np.sqrt((x - 20) ** 2 + (y - 9) ** 2 + (z - 11) ** 2) - 2,
    )
    volume = isowave.compress(10 - balls.transpose(2, 1, 0), tolerance=1e-4)

    def volume_of(mesh):
        a, b, c = (mesh.vertices[mesh.faces[:, i]].astype(np.float64) for i in range(3))
        return (a * np.cross(b, c)).sum() / 6

    def is_watertight(mesh):
        edges = np.concatenate([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)])
        return {*map(tuple, edges)} == {(b, a) for a, b in edges.tolist()}

    assert not is_watertight(volume.extract(5))
    closed = volume.extract(5, closed=True)
    assert is_watertight(closed)
    largest = volume.extract(5, closed=True, largest=1)
    ball = 4 / 3 * np.pi * 7**3
    assert is_watertight(largest) and abs(volume_of(largest) / ball - 1) < 0.02
    cut = 4 / 3 * np.pi * 5**3 - np.pi * 3**2 * (3 * 5 - 3) / 3  # a cap of height 3 is missing
    assert abs((volume_of(closed) - volume_of(largest)) / cut - 1) < 0.04
    with pytest.raises(isowave.Error, match="leave out exact vertices"):
        volume.extract(5, closed=True, vertices="exact")
    simple = volume.extract(5, closed=True, largest=1, simplify=0.25)
    assert is_watertight(simple) and abs(volume_of(simple) / ball - 1) < 0.05
    assert 0.2 < len(simple.faces) / len(largest.faces) < 0.3
    assert 0 < simple.simplify_error < 1 and largest.simplify_error == 0
    by_host = volume.extract(5, closed=True, largest=1, simplify=0.25, device="host")
    assert np.array_equal(by_host.vertices, simple.vertices)
    assert np.array_equal(by_host.faces, simple.faces)
    with pytest.raises(isowave.Error, match="give a share above 0, up to 1"):
        volume.extract(5, simplify=0)


def test_vertices_are_apart_unless_asked_for_exactly():
    """Integers, many at the isovalue: what merges vertices by position finds the mesh closed."""
    volume = isowave.compress(noise((9, 10, 11), 7, values=4).astype(np.uint8), exact=True)
    meshes = {places: volume.extract(2, vertices=places) for places in ("apart", "exact")}
    assert len(meshes["apart"].faces) == len(meshes["exact"].faces)
    num_flat = {}
    for places, mesh in meshes.items():
        a, b, c = (mesh.vertices[mesh.faces[:, i]].astype(np.float64) for i in range(3))
        num_flat[places] = (np.linalg.norm(np.cross(b - a, c - a), axis=1) == 0).sum()
    assert num_flat["apart"] == 0 and num_flat["exact"] > 100
    merged = np.unique(meshes["apart"].vertices, axis=0)
    assert len(merged) == len(meshes["apart"].vertices)
    assert np.abs(meshes["apart"].vertices - meshes["exact"].vertices).max() <= 1 / 1024
    np.testing.assert_array_equal(volume.extract(2).vertices, meshes["apart"].vertices)
    with pytest.raises(ValueError, match="apart and exact"):
        volume.extract(2, vertices="merged")


def test_far_from_the_origin(tmp_path):
    """At the coordinates of maps, float32 would keep a few places of each axis."""
    z, y, x = np.mgrid[:16, :18, :20].astype(np.float32)
    field = np.sqrt((x - 9) ** 2 + (y - 9) ** 2 + (z - 8) ** 2)
    origin = (120.0, 6_700_000.0, 4_500_000.0)
    near = isowave.compress(field, rate=16, spacing=0.125)
    far = isowave.compress(field, rate=16, spacing=0.125, origin=origin)
    meshes = near.extract(5), far.extract(5)
    assert meshes[0].vertices.dtype == np.float32 and meshes[1].vertices.dtype == np.float64
    moved = meshes[1].vertices - origin[::-1]
    np.testing.assert_allclose(moved, meshes[0].vertices, rtol=0, atol=1e-7)

    images = [volume.render(5, size=(40, 30)) for volume in (near, far)]
    assert images[0].position.dtype == np.float32 and images[1].position.dtype == np.float64
    np.testing.assert_array_equal(images[0].rgb, images[1].rgb)
    np.testing.assert_allclose(
        images[1].position - origin[::-1], images[0].position, rtol=0, atol=1e-6
    )
    rays = np.array([[-1, 1.1, 1.05, 1, 0, 0]], np.float64)
    hits = near.cast_rays(rays, 5), far.cast_rays(rays + [*origin[::-1], 0, 0, 0], 5)
    np.testing.assert_allclose(hits[1]["t_hit"], hits[0]["t_hit"], rtol=1e-6)
    np.testing.assert_allclose(
        hits[1]["position"] - origin[::-1], hits[0]["position"], rtol=0, atol=1e-6
    )

    meshes[1].save(tmp_path / "a.ply")
    head, data = (tmp_path / "a.ply").read_bytes().split(b"end_header\n", 1)
    assert b"property double x" in head
    row = np.dtype([("place", "<f8", 3), ("normal", "<f4", 3)])
    vertices = np.frombuffer(data, row, len(meshes[1].vertices))["place"]
    np.testing.assert_array_equal(vertices, meshes[1].vertices)
    with pytest.warns(RuntimeWarning, match=r"add 4500001 6700001 121 to x y z"):
        meshes[1].save(tmp_path / "a.stl")
    assert b"add 4500001 6700001 121 to x y z" in (tmp_path / "a.stl").read_bytes()[:80]


def test_an_isovalue_is_compared_as_it_was_given():
    voxels = np.zeros((5, 5, 5), np.float32)
    voxels[2, 2, 2] = 0.7  # the nearest float32, which is below
    volume = isowave.compress(voxels)
    with pytest.warns(RuntimeWarning, match="isovalue 0.7 is outside"):
        assert len(volume.extract(0.7).faces) == 0
        assert not np.isfinite(volume.render(0.7, size=(32, 32)).depth).any()
    inside = float(np.float32(0.7))
    assert len(volume.extract(inside).faces) == 8


def test_an_isovalue_outside_the_values_is_a_warning():
    volume = isowave.compress(np.arange(1000, dtype=np.uint16).reshape(10, 10, 10), exact=True)
    rays = np.zeros((1, 6)) + [0, 0, 0, 0, 0, 1]
    for isovalue in (-5, 1000):
        text = f"isovalue {isovalue} is outside the volume's values, 0 to 999"
        for draw in (
            lambda value: volume.render(value, size=(16, 8)),
            lambda value: volume.cast_rays(rays, value),
            lambda value: volume.cast_rays(rays, value, device="cpu"),
            volume.extract,
        ):
            with pytest.warns(RuntimeWarning, match=text) as caught:
                draw(isovalue)
            assert caught[0].filename == __file__


def test_what_was_done_to_a_header_is_a_warning(tmp_path):
    header = (
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 4 4\nencoding: raw\nspace: LPS\n"
        'space directions: (2,0,0) (0,2,0) (0,0,2)\nspace units: "um" "um" "um"\n\n'
    )
    (tmp_path / "a.nrrd").write_bytes(header.encode() + bytes(range(64)))
    with pytest.warns(RuntimeWarning, match="space units: um") as caught:
        volume = isowave.open(tmp_path / "a.nrrd", exact=True)
    assert caught[0].filename == __file__
    assert volume.spacing == (0.002, 0.002, 0.002)


def test_progress_and_errors():
    volume = isowave.compress(noise((8, 8, 8), 6), rate=16)
    told = []
    volume.extract(0, progress=lambda what, done: told.append((what, done)))
    assert told[-1] == ("extracting", 1)

    def interrupt(what, done):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        volume.extract(0, progress=interrupt)
    with pytest.raises(ValueError, match="level 1 of a volume"):
        volume.extract(0, level=1)
    with pytest.raises(isowave.Error, match="too small"):
        volume.extract(0, memory_budget=1000)
    empty = volume.extract(1e9)
    assert empty.vertices.shape == (0, 3) and empty.faces.shape == (0, 3)


def test_files(tmp_path):
    volume = isowave.compress(noise((8, 9, 10), 7), rate=16)
    mesh = volume.extract(0)
    for ending in ("ply", "stl", "obj", "vtp", "gltf", "glb"):
        mesh.save(tmp_path / f"a.{ending}")
    pyvista = pytest.importorskip("pyvista")
    for ending in ("ply", "vtp", "obj"):
        read = pyvista.read(tmp_path / f"a.{ending}")
        # VTK reads OBJ's text as float64.
        np.testing.assert_array_equal(np.asarray(read.points, np.float32), mesh.vertices)
        np.testing.assert_array_equal(read.regular_faces, mesh.faces)
    surface = mesh.to_pyvista()
    np.testing.assert_array_equal(surface.point_data.active_normals, mesh.normals)
    assert surface.n_cells == len(mesh.faces)
    with pytest.raises(isowave.Error, match="end the name"):
        mesh.save(tmp_path / "a.off")
