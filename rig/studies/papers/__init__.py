"""Studies: published results reproduced with the code of rig, and the laws and servos of rig compared with others.

ding2015.py   the numbers of Ding, Xiao and Jiang (2015): gains, error system, the complete loop
ding2015_figures.py  its three figures, as one page and one picture
tolerant.py   the fault-tolerant law against the plain law, in flights
rate_bias_study.py  the two laws under biased rates and attitudes, on a grid and drawn at random
"""
