"""The alternation that unknown lights were first solved by, with a Torrance-Sparrow lobe per material.

Kept to compare with; :mod:`..solve` moves everything at once instead. A pixel p shows of a distant light l with the
direction d and the strength s, in colour c::

    y_plc = s_l (rho_pc n_p . d_l + sum_k w_pk t_kc exp(-theta_h^2 / (2 sigma_k^2)) / (4 n_p . v_p)),   n_p . d_l > 0

the Lambertian part and the simplified lobe of Torrance and Sparrow (:mod:`...brdf.parametric`). Minimised is, in turn
over the surface, the normals, the albedo, the lights and the materials, one sum: Cauchy's cost of the misfits, how far
normals are from the surface's, how rough the surface is, how far highlights are from where the normal halves light and
view, how far strengths are from one another, and how strong highlights are that no light shows (:mod:`.state`). No step
raises it. Not modelled: near lights, light that the object throws upon itself.
"""
