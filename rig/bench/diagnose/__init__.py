"""Which sensor of a recording was wrong, since when, and would a manager have isolated it in flight?

The manager of the rig compares the instances of each quantity on means of half a second, after conventions (units,
axes, mounting, delay) are taken off.  A verdict is a bound on one log, not a rate.
"""
