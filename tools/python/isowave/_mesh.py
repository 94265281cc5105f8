"""Isosurfaces as triangle meshes."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from isowave import _core


@dataclass(frozen=True)
class Mesh:
    """Triangles that share their vertices, as Volume.extract gives them.

    Each edge belongs to two triangles, except in the volume's border and beside voxels without
    data. Every triangle has an area, unless vertices="exact" was asked for.
    """

    #: float32 (n, 3): world space, (x, y, z). float64 if float32 would lose more than 1/4096 voxel,
    #: as it does far from the origin.
    vertices: npt.NDArray[np.float32] | npt.NDArray[np.float64]
    #: uint32 (m, 3): numbers of vertices, counter-clockwise seen from where values are lower.
    faces: npt.NDArray[np.uint32]
    #: float32 (n, 3), world space: of length 1, away from larger values. None: not asked for.
    normals: npt.NDArray[np.float32] | None
    #: About the largest distance from the mesh before it was simplified [world units].
    simplify_error: float = 0.0

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a .ply, .stl, .obj, .vtp, .gltf or .glb file, whole or not at all.

        Vertices that float32 does not hold are float64 in .ply, .obj and .vtp. In glTF they are
        relative to a node's translation. In STL they have an offset, which the file's header and a
        RuntimeWarning name.
        """
        notice = _core.save_mesh(self.vertices, self.faces, self.normals, os.fsdecode(path))
        if notice:
            warnings.warn(notice, RuntimeWarning, stacklevel=2)

    def to_pyvista(self) -> Any:
        """A pyvista.PolyData with the normals as point data. Needs pyvista."""
        import pyvista

        vertices: Any = self.vertices
        faces: Any = self.faces.astype(np.int64)
        mesh = pyvista.PolyData.from_regular_faces(vertices, faces)
        if self.normals is not None:
            mesh.point_data.active_normals = self.normals
        return mesh

    def to_trimesh(self) -> Any:
        """A trimesh.Trimesh with the same vertices and faces, and the normals. Needs trimesh."""
        import trimesh

        return trimesh.Trimesh(
            self.vertices, self.faces, vertex_normals=self.normals, process=False
        )

    def __repr__(self) -> str:
        return f"<isowave.Mesh {len(self.vertices)} vertices, {len(self.faces)} faces>"
