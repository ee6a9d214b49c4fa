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
