"""One file per command of the command line; :mod:`pipeline.cli` registers them."""
