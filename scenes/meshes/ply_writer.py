"""Triangle meshes as PLY files in double precision."""

import numpy as np
from jaxtyping import Float, Int


def ply_bytes(
    vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "faces 3"]
) -> bytes:
    """Write a mesh as binary PLY, its vertices as doubles.

    Reading it again gives the same numbers; Mitsuba, Sionna and Blender read it too, and round
    to single precision (a place at 1 m to 0.1 µm, which is a tenth of a degree of phase at
    300 GHz, there and back).

    Parameters
    ----------
    vertices
        In the file's unit. [m]
    faces
        Indices of each triangle's corners, counter-clockwise as seen from outside.
    """
    header = "\n".join(
        [
            "ply",
            "format binary_little_endian 1.0",
            f"element vertex {len(vertices)}",
            *(f"property double {axis}" for axis in "xyz"),
            f"element face {len(faces)}",
            "property list uchar int vertex_indices",
            "end_header\n",
        ]
    )
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    return header.encode() + vertices.astype("<f8").tobytes() + rows.tobytes()
