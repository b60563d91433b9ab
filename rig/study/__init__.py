"""Studies: published results computed again by the rig's own code.

ding2015.py  the numbers of Ding, Xiao and Jiang 2015: gains, error system, honest experiment
figures.py   its three figures, as one page and one picture
cli.py       ``rig study``
"""
