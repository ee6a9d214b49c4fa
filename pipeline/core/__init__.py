"""Arrays in, arrays out: the data model and the solvers. Nothing in here imports bpy."""
