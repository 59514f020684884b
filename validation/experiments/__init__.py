"""Experiments of the thesis and our own: one module for each figure or table.

Run one as ``python -m validation.experiments.fig02_10_nlos_posts``; it writes its numbers and its
figure, and fails if a figure is outside its limits. Claims call the same functions.
"""
