"""The tables of a mapping file: frequencies, times, positions and samples, with their keys.

Each is checked as it is read, before any data: see :mod:`mmslam.formats.mapping` for the whole.
"""
