"""Thresholds from a budget of false isolations, by the healthy flights themselves (docs/thresholds.md).

run.design            recordings to designs: what ``rig thresholds`` does
distances.exceeded    the series whose exceedances are false isolations
tail.peaks            peaks over a threshold, and the law of their tail
tradeoff.tradeoff     what a design finds
"""
