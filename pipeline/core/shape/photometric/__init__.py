"""Photometric methods: normals, basis BRDFs and weight maps of every pixel from known lights."""
