"""Photographs as a capture: what lies in a folder is recognised, decoded, merged and written as a capture folder.

``formats``    which files are the photographs, under which lights: a :class:`.photographs.Photographs`.
``outlines``   a sphere found in its mask or its pictures.
``spheres``    light directions from a mirror sphere, directions and intensities from a diffuse one.
``response``   values as stored to values proportional to the light.
``exposures``  several exposures of one light merged.
``develop``    the capture folder.

Files are read by a function that the caller gives, see :data:`.photographs.Reader`.
"""
