"""Scenes of other programs, a row each: what they cost, and how near Sionna's path solver.

Run as ``python -m validation.trials.foreign_scenes`` for the scenes that Sionna RT ships, or with
names of these, TOML files, or folders of them.
"""
