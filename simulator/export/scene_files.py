"""A scenario as Mitsuba XML and PLY files, which Sionna RT, Blender and mmslam open.

Two scenes are written. ``NAME.xml`` holds the smooth mean surfaces, their roughness in the
scattering coefficients: it is for Sionna's own solvers. ``NAME_facets.xml`` holds one frozen
realisation, every facet as it is simulated, and no scattering coefficient: ``NAME_facets.toml``
is the scenario of it, and simulates the same. Its objects keep their smooth shapes and the
statistics of their roughness, which mirrors and chains of them need, and take their facets from
the meshes of the frozen scene.
"""

from collections.abc import Iterator
from xml.etree import ElementTree

from scenes.checks.facet_budget import facet_counts
from scenes.files.relocatable import relocatable
from scenes.files.toml_writer import toml_text
from scenes.meshes.ply_writer import ply_bytes
from scenes.realisations.object_surface import Surface, object_surface
from scenes.realisations.surface_mesh import surface_to_mesh
from scenes.scenario import Scenario
from simulator.export.sionna_scene import material_colour
from simulator.geometry.mean_surfaces import mean_surfaces, rms_height
from simulator.geometry.ray_scene import HALF_HEIGHT
from simulator.materials.sionna_materials import sionna_slab
from simulator.scene.radio_scene import scenario_materials

MOST_FROZEN = 10_000_000
"""Most facets of a realisation that is written: 600 MB of PLY. [-]"""


def frozen_facets(scenario: Scenario) -> int:
    """Count the facets of a scenario's frozen realisation: of whole surfaces, all around."""
    wavelength = scenario.radio.shortest_wavelength
    flat = scenario.dimensions == 2
    return sum(facet_counts(scenario.objects, wavelength, flat=flat).values())


def exported_files(
    scenario: Scenario, *, seed: int = 0, sample: int = 0
) -> Iterator[tuple[str, bytes]]:
    """Write a scenario's two scenes to memory, file after file.

    The frozen one is left out if it has more than :data:`MOST_FROZEN` facets.

    Parameters
    ----------
    scenario
        In 2-D, its lines become upright strips across z = 0.
    seed, sample
        Which realisation of the roughness is frozen.

    Yields
    ------
    Names, relative to the folder of the export, and contents. The same scenario and seed give
    the same bytes.

    Raises
    ------
    ScenarioError
        If a material is not known over the band.
    """
    whole = frozen_facets(scenario) <= MOST_FROZEN
    for suffix in ("", "_facets") if whole else ("",):
        frozen = bool(suffix)
        name = scenario.name + suffix
        yield f"{name}.xml", _scene_xml(scenario, f"{name}_meshes", frozen=frozen)
        surfaces = (
            (object_surface(scenario, body, seed=seed, sample=sample) for body in scenario.objects)
            if frozen
            else mean_surfaces(scenario)
        )
        for surface in surfaces:
            yield f"{name}_meshes/{surface.name}.ply", _ply(surface)
    if not whole:
        return
    moved = relocatable(_drawn(scenario))
    tables = moved.tables
    tables["name"] = f"{scenario.name}_facets"
    for name, body in tables.get("objects", {}).items():
        body["realisation"] = f"{scenario.name}_facets_meshes/{name}.ply"
    yield f"{scenario.name}_facets.toml", toml_text(tables).encode()
    for name, source in moved.files.items():
        yield name, source.read_bytes()


def _drawn(scenario: Scenario) -> Scenario:
    """Return the scenario without realisations that it may have been loaded with."""
    bodies = {n: b.model_copy(update={"realisation": None}) for n, b in scenario.objects.items()}
    return scenario.model_copy(update={"objects": bodies})


def _ply(surface: Surface) -> bytes:
    flat = surface.cells.shape[1] == 2
    mesh = surface_to_mesh(surface, extrude=2 * HALF_HEIGHT if flat else None)
    return ply_bytes(mesh.vertices, mesh.faces)


def _scene_xml(scenario: Scenario, folder: str, *, frozen: bool) -> bytes:
    root = ElementTree.Element("scene", {"version": "3.0.0"})
    frequency = scenario.radio.centre_frequency
    for name, material in scenario_materials(scenario).items():
        slab = sionna_slab(
            material, frequency, rms_height=0.0 if frozen else rms_height(scenario, name)
        )
        # A suffix, since Sionna takes away 'mat-', and an object has the name already.
        bsdf = ElementTree.SubElement(
            root, "bsdf", {"type": "radio-material", "id": f"mat-{name}-surface"}
        )
        for key, value in slab._asdict().items():
            ElementTree.SubElement(bsdf, "float", {"name": key, "value": repr(float(value))})
        colour = " ".join(str(part) for part in material_colour(scenario.objects[name].material))
        ElementTree.SubElement(bsdf, "rgb", {"name": "color", "value": colour})
    for name in scenario.objects:
        shape = ElementTree.SubElement(root, "shape", {"type": "ply", "id": f"mesh-{name}"})
        file = {"name": "filename", "value": f"{folder}/{name}.ply"}
        ElementTree.SubElement(shape, "string", file)
        ElementTree.SubElement(shape, "boolean", {"name": "face_normals", "value": "true"})
        ElementTree.SubElement(shape, "ref", {"name": "bsdf", "id": f"mat-{name}-surface"})
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"
