"""Texture coordinates for meshes that have none."""

from __future__ import annotations

import bpy

PROJECTED = "Lightsphere"  # the layer's name
ISLAND_MARGIN = 0.01  # between charts, share of the texture


def unwrap(scene: bpy.types.Scene, meshes: list[bpy.types.Mesh]) -> None:
    """Give meshes without UVs a layer of charts (Blender's Smart UV Project) that share one square without overlap.

    Objects of collections that a scene only shows instances of cannot be edited; copies of all are, whose mesh is the
    same.
    """
    if not meshes:
        return
    copies = [bpy.data.objects.new(mesh.name, mesh) for mesh in meshes]
    chosen = [item for item in scene.objects if item.select_get()]
    objects = scene.view_layers[0].objects
    active = objects.active
    for item in chosen:
        item.select_set(False)
    for copy in copies:
        copy.data.uv_layers.new(name=PROJECTED)
        scene.collection.objects.link(copy)
        copy.select_set(True)
    objects.active = copies[0]
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(island_margin=ISLAND_MARGIN)
    bpy.ops.object.mode_set(mode="OBJECT")
    for copy in copies:
        bpy.data.objects.remove(copy)
    for item in chosen:
        item.select_set(True)
    objects.active = active
