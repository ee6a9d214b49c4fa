"""Lightsphere's pipeline: pictures under many lights in, meshes with relightable materials out.

Stages, the same word in every layer (command line, core, Blender side, operator, panel, tests)::

    capture -> shape -> reflectance -> material -> relight -> compare

and beside them ``inverse``, ``plan`` (which effects a scene needs), ``tradeoff`` (accuracy against
time), ``dataset`` (many captures) and ``demo`` (the whole path on a built-in scene).

Layers
------
``pipeline.core``      arrays in, arrays out; no bpy.
``pipeline.blender``   bpy without user interface: scenes, rig, Cycles, meshes, materials.
``pipeline.report``    pictures and pages for people, by matplotlib and HTML; imports core alone.
``pipeline.commands``  one file per command; ``pipeline.cli`` puts them together.

Conventions
-----------
* ``wi`` points to the light and ``wo`` to the camera; both unit, both leaving the surface.
* Lengths in metres, radiant intensity I in W/sr, irradiance E in W/m^2, BRDF f in 1/sr. Images hold
  radiance L, linear Rec.709, float32, rows top-down; Blender's pixel buffer is bottom-up and is
  flipped in one place, :mod:`pipeline.blender.pixels`.
* Camera space: x right, y up, z to the viewer. Normals are in camera space unless a name says
  otherwise (``world_normal``). Pixel (row r, column c) has its centre at (c + 0.5, r + 0.5).
* ``depth`` is the distance along the unit ray of a pixel: from the camera's centre for a pinhole,
  from the camera's plane for an orthographic camera.
* Axis letters in order: L lights, H W image, P pixels (masked, flat), K bases, 3 colours.
* float64 arithmetic where sums cancel, float32 for image stacks.

A near light of radiant intensity I at distance d makes L = f cos(theta) I / d^2, so that
y = L d^2 / I is the *apparent BRDF*: BRDF x cosine x visibility, plus interreflection when the
pictures contain it. That product is what the double sphere compares; nothing is divided out of it.

References
----------
DLS   Magda, Kriegman, Zickler, Belhumeur, "Beyond Lambert: Reconstructing Surfaces with Arbitrary
      BRDFs", ICCV 2001.
UNC   image-based recovery of shape and spatially varying reflectance under unknown lights.
ACLS  Alldrin, Zickler, Kriegman, "Photometric stereo with non-parametric and spatially-varying
      reflectance", CVPR 2008.
INV   Boivin, Gagalowicz, "Image-based rendering of diffuse, specular and glossy surfaces from a
      single image", SIGGRAPH 2001.
"""
