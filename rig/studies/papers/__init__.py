"""Studies: published results computed again by the rig's own code, and our answer to them.

ding2015.py   the numbers of Ding, Xiao and Jiang 2015: gains, error system, the whole loop flown
ding2015_figures.py  its three figures, as one page and one picture
tolerant.py   the fault-tolerant law against the plain one, flown
rate_bias_study.py  the two laws under biased rates and attitudes, of a grid and drawn at random, flown and counted
"""
