import io

import numpy as np
import trimesh

from scenes.meshes.ply_writer import ply_bytes


def test_a_mesh_is_read_back_to_the_last_bit() -> None:
    rng = np.random.default_rng(1)
    vertices = rng.normal(size=(50, 3))
    faces = rng.permutation(48).reshape(16, 3)
    mesh = trimesh.load_mesh(io.BytesIO(ply_bytes(vertices, faces)), file_type="ply", process=False)
    np.testing.assert_array_equal(mesh.vertices, vertices)
    np.testing.assert_array_equal(mesh.faces, faces)
