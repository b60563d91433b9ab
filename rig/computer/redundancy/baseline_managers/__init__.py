"""Baselines: monitors of the literature other than a comparison, as managers that can be flown for comparison.

baseline_settings.py  what each is told: pydantic models, and what kernels read of them
step.py      what all share in a frame: ranks, middle, one failure, latches
sums.py      cusum, innovation: sums of what exceeds an allowance
glr.py       generalised likelihood ratio over the onset, of a step and of a ramp
parity.py    parity vector, and the channel that it points along
bayes.py     posterior of every set of faulty members
windows.py   a median over a window, a mean within a gate
averages.py  averages by variances, without the ends, of the first three: they isolate no channel
learned_bias.py    the bias of each channel, learned, for all that compare residuals
learned_voters.py  the cross-voter and the selection behind learned biases

Each is a kernel of a row, as managers are, and is compiled when it is first flown.
"""
