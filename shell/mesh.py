"""Mesh files of the real solid: STL and PLY for slicers (in mm), GLB for viewers (in m), still or swinging.

>>> data = encode_mesh(build_surface(resonator), "stl")
"""

import json
import struct
from math import pi
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from shell.errors import ShellError
from shell.quadrature import Array
from shell.surface import Surface

if TYPE_CHECKING:
    import trimesh

MM_PER_M = 1e3
KEYS = 17  # key frames of one period
PERIOD = 1.4  # s, of the swing in a viewer
FLOAT, BYTE, INT = 5126, 5121, 5125  # glTF component types
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
    if animated and swing == 0:
        raise ShellError("an animation needs a swing other than 0.")
    buffers = _Buffers()
    rest = surface.points if animated else surface.points + swing * surface.displacement
    attributes = {"POSITION": buffers.add(rest, FLOAT, "VEC3", bounds=True)}
    if colours is not None:
        padded = np.full((len(colours), 4), 255, dtype=np.uint8)
        padded[:, : colours.shape[1]] = colours
        attributes["COLOR_0"] = buffers.add(padded, BYTE, "VEC4", normalized=True)
    primitive: dict[str, Any] = {
        "attributes": attributes,
        "indices": buffers.add(surface.triangles.reshape(-1), INT, "SCALAR"),
        "material": 0,
    }
    mesh: dict[str, Any] = {"primitives": [primitive]}
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "hrg-workbench"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "rotation": UPRIGHT}],
        "meshes": [mesh],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.7}}],
    }
    if animated:
        primitive["targets"] = [{"POSITION": buffers.add(swing * surface.displacement, FLOAT, "VEC3", bounds=True)}]
        mesh["weights"] = [1.0]
        turn = np.linspace(0, 1, KEYS)
        sampler = {
            "input": buffers.add(turn * PERIOD, FLOAT, "SCALAR", bounds=True),
            "output": buffers.add(np.cos(2 * pi * turn), FLOAT, "SCALAR"),
            "interpolation": "LINEAR",
        }
        channel = {"sampler": 0, "target": {"node": 0, "path": "weights"}}
        document["animations"] = [{"name": "mode", "samplers": [sampler], "channels": [channel]}]
    return buffers.pack(document)


class _Buffers:
    """The binary chunk of a GLB while it grows, with its views and accessors."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(
        self, values: "Array | NDArray[Any]", component: int, kind: str, bounds: bool = False, normalized: bool = False
    ) -> int:
        """Append an array and return the number of its accessor."""
        packed = np.ascontiguousarray(values, dtype={FLOAT: "<f4", BYTE: "u1", INT: "<u4"}[component])
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": packed.nbytes})
        self.data += packed.tobytes()
        self.data += bytes(-len(self.data) % 4)
        accessor: dict[str, Any] = {
            "bufferView": len(self.views) - 1,
            "componentType": component,
            "count": len(packed),
            "type": kind,
        }
        if normalized:
            accessor["normalized"] = True
        if bounds:
            flat = packed.reshape(len(packed), -1)
            accessor |= {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def pack(self, document: dict[str, Any]) -> bytes:
        """Return header, JSON chunk and binary chunk."""
        whole = {
            **document,
            "buffers": [{"byteLength": len(self.data)}],
            "bufferViews": self.views,
            "accessors": self.accessors,
        }
        text = json.dumps(whole, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = (
            struct.pack("<I4s", len(text), b"JSON")
            + text
            + struct.pack("<I4s", len(self.data), b"BIN\0")
            + bytes(self.data)
        )
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
