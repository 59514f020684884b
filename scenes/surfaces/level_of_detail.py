"""Which bodies reflect as mirrors of flat faces where cutting them into facets would be waste.

A smooth flat face needs no facets for its reflection: the image of an antenna behind it gives the
same field wherever the face is much larger than a Fresnel zone. Facets are needed where a surface
is rough, curved, or small.
"""

import numpy as np

from scenes.meshes.mesh_file import placed_mesh
from scenes.schema.objects import Body, Box, MeshFile, Plate
from scenes.surfaces.facet_spacing import facet_spacing, mesh_facet_count
from scenes.surfaces.mesh_refinement import flat_patches

LEAST_FACE = 10.0
"""Mean width of a mesh's flat faces, over the wavelength, above which they count as flat walls and
not as the approximation of something round: the first Fresnel zone of a link is that wide at a
hundred wavelengths, a metre at 30 GHz. Chosen. [-]"""
MOST_FACES = 1000
"""Flat faces of one mesh above which it stands for something round, whatever their size: each would
be a mirror of its own, and every pair of them a chain. A room of 3000 triangles has some tens.
Chosen. [-]"""

MOST_ROUND = 2**24
"""Facets of a mesh with more faces beyond which these are mirrors after all, where the scenario
says that they are walls (``flat_faces``; of a file of another program always, as its path solver
takes them): terrain and roofs of a town, of which facets would take hours. A ball is none: its
faces would be thousands of mirrors. Chosen. [-]"""


def flat_and_smooth(body: Body, wavelength: float) -> bool:
    """Return whether a body of a 3-D scene consists of smooth flat faces.

    Parameters
    ----------
    body
        The object. A cylinder is curved; a mesh whose facets are taken as they are may hold
        roughness, and so does a realisation.
    wavelength
        The longest of the band. [m]
    """
    if body.frozen is not None or (body.roughness is not None and body.roughness.rms > 0):
        return False
    match body:
        case Plate() | Box():
            return True
        case MeshFile(facets="cut"):
            mesh = placed_mesh(body)
            faces = int(flat_patches(mesh).max()) + 1
            wide = np.sqrt(mesh.area / faces) >= LEAST_FACE * wavelength
            if not wide or faces <= MOST_FACES:
                return bool(wide)
            if not body.flat_faces:
                return False
            spacing = facet_spacing(body, wavelength)
            return mesh_facet_count(mesh.area, len(mesh.faces), spacing) > MOST_ROUND
        case _:
            return False
