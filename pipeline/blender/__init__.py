"""Everything that needs bpy and no user interface. Functions take the scene and objects they work on."""
