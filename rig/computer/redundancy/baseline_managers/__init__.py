"""Baselines: monitors of the literature other than a comparison, as managers that can be flown for comparison.

baseline_settings.py is what each is told, step.py what all share in a frame; the header of every other file describes
its managers.  Each is a kernel of one signal of a row, and is compiled when it is first flown.
"""
