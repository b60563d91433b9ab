"""Design thresholds for a false-isolation rate from healthy flights (docs/explanation/thresholds.md).

design_run.run        recordings to designs: the work of ``rig thresholds``
distances.exceeded    the series whose exceedances are false isolations
tail.peaks            peaks over a threshold, and the law of their tail
tradeoff.tradeoff     the faults that a design isolates
"""
