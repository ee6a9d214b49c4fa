"""How far results may be from what they should be, and why."""

# Capture
# Cycles computes in float32: 1e-6 at best, a few 1e-5 where distances of some metres are subtracted and the shading
# normal is interpolated between vertices.
RADIANCE_LAMBERT = 5e-5
# Cycles evaluates the GGX lobe in float32 from a half vector of float32 directions: up to 1e-3 for alpha >= .04.
RADIANCE_GGX = 2e-3
# Two lights behind each other give the same d^2 L but for float32 rounding of both distances.
COLLINEAR = 2e-5
# Cycles samples within 0.01 px of the pixel's centre.
POSITION_PIXELS = 2e-3
# Half floats have 11 significant bits.
HALF = 2**-11
# A second user of a mesh moves the ray-triangle test into object space: rounding alone.
MESH_CACHE = 1e-4

# Shape as a mesh, first reflectance
# A mesh keeps float64; its points come from float32 depths of 1 to 10 m.
MESH_POINT = 2e-6
# PLY files keep float32.
SINGLE = 1e-6
# Pictures are float32 and the table of roughnesses is refined by a parabola: a planted lobe comes back within these.
PLANTED_ALBEDO = 0.01
PLANTED_SPECULAR = 0.03
PLANTED_ROUGHNESS = 0.01
# Held-out pictures of a planted material, relative RMS; a 5 % wrong albedo must not pass.
HELD_OUT = 0.02
# Cycles against the closed form of the recovered lobes, direct light: GGX as above, on textures of half float.
NODES = 3e-3
# Textures are packed as half floats.
TEXTURE = 2**-11
# A camera's lens and shift are float32 in Blender.
CAMERA_PIXELS = 1e-3
