"""Shader nodes added, linked and arranged in few words."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .meshes import UV_LAYER

COLUMN, ROW = 200.0, 180.0
WHITE = (1.0, 1.0, 1.0, 1.0)
NORMAL_MAP = "Normal Map"
NEUTRAL = (0.5, 0.5, 1.0, 1.0)  # of a normal map in tangent space: the mesh's own normal


class Graph:
    """A node tree whose nodes stand on a grid: columns to the right, rows down."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree
        self.frame: Any = None

    def framed(self, label: str) -> None:
        """Let the nodes added from now on stand in a frame with a label."""
        self.frame = None
        self.frame = self.add("NodeFrame", 0, 0, label=label)

    def add(self, kind: str, column: float, row: float, **properties: Any) -> Any:
        """Add a node with some properties; a socket, number or colour under ``inputs`` is linked or set in order."""
        inputs = properties.pop("inputs", ())
        node = self.tree.nodes.new(kind)
        node.location = (COLUMN * column, -ROW * row)
        node.parent = self.frame
        for name, value in properties.items():
            setattr(node, name, value)
        for socket, value in zip(node.inputs, inputs, strict=False):
            self.feed(socket, value)
        return node

    def feed(self, socket: Any, value: Any) -> None:
        """Link an output to an input, or set the input's value."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def math(
        self, operation: str, column: float, row: float, *inputs: Any, label: str = "", clamp: bool = False
    ) -> Any:
        """Add a Math node and return its output."""
        node = self.add("ShaderNodeMath", column, row, operation=operation, label=label, inputs=inputs)
        node.use_clamp = clamp
        return node.outputs[0]

    def vector(self, operation: str, column: float, row: float, *inputs: Any, label: str = "") -> Any:
        """Add a Vector Math node, which unlike Mix Color clamps nothing, and return its vector."""
        return self.add("ShaderNodeVectorMath", column, row, operation=operation, label=label, inputs=inputs).outputs[0]

    def scaled(self, column: float, row: float, vector: Any, factor: Any, label: str = "") -> Any:
        """Add a Vector Math node that scales, and return its vector."""
        node = self.add("ShaderNodeVectorMath", column, row, operation="SCALE", label=label, inputs=(vector,))
        self.feed(node.inputs["Scale"], factor)
        return node.outputs[0]

    def feed_map(self, socket: Any, values: NDArray[np.float32], make: Callable[[], Any], row: float) -> None:
        """Link a texture (H, W) or (H, W, 3) to an input, or set its value where it is the same everywhere."""
        flat = values.reshape(-1, *values.shape[2:])
        if np.ptp(flat, axis=0).max() == 0:
            self.feed(socket, (*map(float, flat[0]), 1.0) if flat.ndim == 2 else float(flat[0]))
        else:
            self.feed(socket, self.texture(-2, 1.6 * row, make(), socket.name).outputs["Color"])

    def texture(self, column: float, row: float, image: bpy.types.Image, label: str) -> Any:
        """Add an Image Texture node that goes on at its border as it ends."""
        return self.add("ShaderNodeTexImage", column, row, label=label, width=240.0, image=image, extension="EXTEND")


def new_material(name: str) -> bpy.types.Material:
    """Make a material without nodes whose normals Cycles takes as they are."""
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    material.cycles.use_bump_map_correction = False  # it would darken what a normal map tilts
    material.node_tree.nodes.clear()
    return material


def normal_from_map(graph: Graph, colour: Any, column: float, row: float) -> Any:
    """Add a Normal Map node in tangent space and return its normal."""
    node = graph.add("ShaderNodeNormalMap", column, row, space="TANGENT", uv_map=UV_LAYER)
    graph.feed(node.inputs["Color"], colour)
    return node.outputs["Normal"]
