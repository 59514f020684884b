"""Experiments of the thesis and our own: one file for each figure or table.

Run one as ``python -m validation.experiments.fig02_10_nlos_posts``; it writes its numbers and its
figure, and refuses what falls outside its limits. Claims call the same functions.
"""
