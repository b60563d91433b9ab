"""Find which sensor of a recording was wrong, since when, and whether the manager would have isolated it.

The manager of the rig compares the instances of each quantity on means of half a second, after conventions (units,
axes, mounting, delay) are corrected.  A verdict is a bound on one log, not a rate.
"""
