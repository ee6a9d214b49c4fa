"""Shape, lights and reflectance from photographs under unknown lights; :mod:`.recover` is the whole of it."""
