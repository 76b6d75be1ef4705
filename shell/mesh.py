"""Mesh files of the real solid: STL and PLY for slicers (in mm), GLB for viewers (in m), still or swinging.

>>> data = encode_mesh(build_surface(resonator), "stl")
"""

from math import pi
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from shell.errors import ShellError
from shell.surface import Surface

if TYPE_CHECKING:
    import trimesh

MM_PER_M = 1e3
KEYS = 17  # key frames of one period
PERIOD = 1.4  # s, of the swing in a viewer
FLOAT = 5126  # of glTF
UPRIGHT = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]  # glTF has y up; the axis of the resonator is z

MeshKind = Literal["stl", "ply", "glb"]


def build_mesh(surface: Surface, swing: float = 0.0) -> "trimesh.Trimesh":
    """Return the watertight mesh of a surface in metres, displaced by `swing` (m, at the largest displacement)."""
    import trimesh

    mesh = trimesh.Trimesh(surface.points + swing * surface.displacement, surface.triangles, process=False)
    if not (mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0):
        raise ShellError("the surface does not close into a solid; make the swing smaller.")
    return mesh


def encode_mesh(
    surface: Surface, kind: MeshKind, swing: float = 0.0, colours: "NDArray[np.uint8] | None" = None
) -> bytes:
    """Return the bytes of a mesh file: STL and PLY in mm, GLB in m; `swing` (m) at the antinode, `colours` in bytes."""
    mesh = build_mesh(surface, swing)
    if kind == "glb":
        return encode_animation(surface, swing, colours, animated=False)
    mesh.apply_scale(MM_PER_M)
    if colours is not None:
        mesh.visual.vertex_colors = colours
    data = mesh.export(file_type=kind)
    return data if isinstance(data, bytes) else str(data).encode()


def encode_animation(
    surface: Surface, swing: float, colours: "NDArray[np.uint8] | None" = None, animated: bool = True
) -> bytes:
    """Return a GLB in which the mode swings, one morph target of weight cos ωt (glTF 2.0), or the still solid at its largest swing."""
    import trimesh
    from trimesh.exchange.gltf import export_glb

    if animated and swing == 0:
        raise ShellError("an animation needs a swing other than 0.")
    moved = swing * surface.displacement
    rest = surface.points if animated else surface.points + moved
    mesh = trimesh.Trimesh(rest, surface.triangles, vertex_colors=colours, process=False)
    if animated:
        mesh.vertex_attributes["moved"] = moved

    def finish(buffers: dict[str, bytes], document: dict[str, Any]) -> None:
        (shape,) = document["meshes"]
        (primitive,) = shape["primitives"]
        primitive["material"] = 0
        document["materials"] = [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.7}}]
        document["asset"]["generator"] = "hrg-workbench"
        document |= {"scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "rotation": UPRIGHT}]}
        if not animated:
            return
        primitive["targets"] = [{"POSITION": primitive["attributes"].pop("_moved")}]
        shape["weights"] = [1.0]
        sampler: dict[str, Any] = {"interpolation": "LINEAR"}
        turn = np.linspace(0, 1, KEYS)
        for name, values in (("input", turn * PERIOD), ("output", np.cos(2 * pi * turn))):
            row = values.astype("<f4")
            about = {"bufferView": len(buffers), "componentType": FLOAT, "type": "SCALAR", "count": KEYS}
            sampler[name] = len(document["accessors"])
            document["accessors"][name] = {**about, "min": [float(row.min())], "max": [float(row.max())]}
            buffers[name] = row.tobytes()
        channel = {"sampler": 0, "target": {"node": 0, "path": "weights"}}
        document["animations"] = [{"name": "mode", "samplers": [sampler], "channels": [channel]}]

    return bytes(export_glb(mesh, include_normals=False, buffer_postprocessor=finish))
