"""Dataset: many captures of drawn shapes, materials, lights and cameras, each the same wherever it is made.

A :mod:`.recipe` says what may be drawn, :mod:`.draw` draws one sample of it from the recipe, its seed and the sample's
number alone, :mod:`pipeline.blender.dataset` renders it, :mod:`.sensor` makes photographs of its pictures, and
:mod:`.farm` shares the samples out to processes that may die at any time. :mod:`.folder` is what is on disk.
"""
