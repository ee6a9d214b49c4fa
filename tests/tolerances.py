"""How far results may be from what they should be, and why."""

# Capture
# Cycles computes in float32: 1e-6 at best, a few 1e-5 where distances of some metres are subtracted and the shading
# normal is interpolated between vertices.
RADIANCE_LAMBERT = 5e-5
# Cycles evaluates the GGX lobe in float32 from a half vector of float32 directions: up to 1e-3 for alpha >= .04.
RADIANCE_GGX = 2e-3
# Two lights behind each other give the same d^2 L but for float32 rounding of both distances.
COLLINEAR = 2e-5
# Cycles samples pixel centres but for float32's rounding of camera and position; half a step of its table of a box
# filter, 5e-4, must not pass.
POSITION_PIXELS = 2e-4
# A GPU's compiler orders float32 operations its own way and takes short forms of roots and quotients.
GPU_DIRECT = 1e-4
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

# The shape solver
# Central differences with steps of 1e-6 in float64 keep 8 digits of the residuals' 1e-16 over 1e-6, less curvature.
JACOBIAN = 1e-5
# The model against the closed form that it contains: reordered float64 sums and cube roots.
CLOSED_FORM = 1e-7
# Walter's rational fit of Beckmann's Lambda is good to .35 %, of which light and viewer have one each.
WALTER_LAMBDA = 0.01
# The lobe of the least kappa, 1e-7, over Beckmann's: kappa x^2 / 2, x = 8 the exponent.
LEAST_KAPPA = 1e-5
# A planted depth without noise, [m] at some 5 m: where Levenberg-Marquardt ends.
PLANTED_DEPTH = 1e-4
# Depth on drawn float32 pictures, % of the diameter: float32 depths of 5 m hold 3e-5 % of 1.6 m. Lambda of the
# Beckmann lobe is Walter's fit, good to .35 % of the picture.
DEPTH_EXACT = 1e-3
DEPTH_BECKMANN = 0.02
# Angles from float32 normals, degrees, where the depths are exact.
NORMAL_EXACT = 0.02
# Depths of equivalent captures [% of the diameter]: float32 pictures are rounded differently, and where the model only
# approximates the lobe, Levenberg-Marquardt ends once a step gains less than 1e-5 of the cost that is left.
EQUIVALENT = 5e-3
# An estimated noise level of a few thousand values, relative; the clipped one leans on few.
NOISE_FLOOR = 0.3

# Photometric stereo
# Azimuth by symmetry, times the sine of the slant [degrees]: a picture under 150 lights, some 11 degrees apart, is
# interpolated linearly between three of them.
AZIMUTH = 0.1
# A planted glossy surface by tables of 64 x 6 nodes: median angle [degrees] and relative RMS of f cos. The normals at
# the rim lie between few lights; tables and normals make up for each other's errors there, and a table takes up some
# of the other as long as weights can make up for it.
PLANTED_NORMAL = 0.3
PLANTED_TABLE = 0.15

# Relighting
# A Blender light against the emitters it becomes, on a Lambertian floor, over the largest radiance: float32 for points;
# for areas Cycles' noise at 256 samples and the sum of 64 elements instead of an integral.
RELIT_POINT = 2e-4
RELIT_AREA = 0.02
# A light of the capture gives its picture back: float32 ratios times float32 weights.
RELIT_KEPT = 2e-6
# Lambert on exact depth: float32 depth of some 5 m against lights 1 m away, and the floor under the expectation.
RELIT_LAMBERT = 2e-3
# One planted GGX lobe, of a width between two of the model's, under 80 lights.
RELIT_GLOSSY = 0.05
# The sum of 256 directions instead of an integral over the hemisphere.
RELIT_SKY = 0.02
# Correlation of planted weight maps with those found: a basis may hold a little of another material.
PLANTED_MAPS = 0.9

# Material
# Sums over 32,000 pairs of directions, or 8,192 of one view, instead of integrals; the coarser set of stretched lobes
# has a third of a per cent, grazing views of sharp lobes most.
QUADRATURE = 0.012
# A planted mixture of lobes of the dictionary, relative RMS: a ridge of 1e-7 and lobes that nearly stand for others.
PLANTED_MIXTURE = 5e-3
# Cycles against the closed forms of its closures, relative RMS over a sphere: float32, and its tables of a ramp.
RENDERED = 2e-3
# Ward's normalisation holds for small alpha, to about 3 alpha^2: alpha up to .05 here, sums over 8,192 directions.
WARD = 0.01
# A smooth BRDF between the bins of a MERL table, median: interpolation over a degree.
BETWEEN_BINS = 5e-3

# Tables on a known shape
# A planted bivariate material on lights held out, relative RMS: the few values at grazing light, which
# weigh most, say little about the nodes there.
TABLES_HELD_OUT = 0.04
# Its BRDF at any pair of directions that were seen, relative, 90th percentile.
TABLES_BRDF = 0.1
# A tangent-space map under bilinear lookup, median: the coordinates of a simple mesh are not linear in perspective.
NORMAL_MAP = 2e-3
# Fitting eight parameters to every thirteenth pair of directions.
PLANTED_PRINCIPLED = 0.02
# Cycles takes the albedo of the Principled BSDF's specular layer from a table.
RENDERED_PRINCIPLED = 4e-3
# Textures of 8 bits.
EIGHT_BITS = 0.5 / 255 + 1e-4

# Unknown lights
# A ball of two materials, 12 lamps of strengths 20 % apart, 40 degrees of view: what is left of the bas-relief
# ambiguity [degrees]; strengths go with it, relative.
UNKNOWN_LIGHTS = 2.5
UNKNOWN_NORMALS = 3.0
UNKNOWN_STRENGTHS = 0.03
# Median error of near lamps' distances [%]: what falloff tells of them where pixels are few and noisy.
UNKNOWN_DISTANCES = 3.0
# The photographs given back by lights, normals and tables, relative RMS: a table is a mean over azimuths, and at the
# rim a lobe falls steeply.
UNKNOWN_PICTURE = 0.08
# The alternation, all but one kind of unknowns being true and the pictures without noise: lights end where Newton's
# steps are rounding [degrees], normals within half the search's smallest angle, lobes where pixels that see little of
# them no longer pull. A surface of triangles of 1/16 of a ball is off by its sagitta, most at the outline.
TURNED_LIGHTS = 0.01
TURNED_STRENGTHS = 1e-3
SEARCHED_NORMALS = 0.5
SPLIT_WIDTHS = 1e-3
SPLIT_OWNED = 0.95
LAID_SURFACE = 0.03

# A camera's curve from four noisy 8-bit exposures, relative to the light: a broken line of 24 pieces.
MEASURED_RESPONSE = 0.04

# Closed forms against Cycles: float32 in Cycles, and a few pixels where a shadow or a silhouette begins.
CLOSED_FORM_PIXEL = 1e-4  # relative, at 99 of 100 lit pixels
CLOSED_FORM_LIGHT = 5e-4  # light that differs, of all light

# A focal length from five photographs of a checkerboard of 35 corners, 480 px wide, relative.
FOCAL = 0.01

# Light between the walls of a bowl, relative: the noise of some sixty samples a pixel, and a mesh of facets.
BETWEEN_WALLS = 0.04

# Lights and normals of a drawn bowl of 900 pixels, with shadows over much of it [degrees].
HOLLOW = 2.0
