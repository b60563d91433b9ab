"""A voter with arrays of its own, for an FMU by PythonFMU3 (FMI 3.0): the median of each signal's channels."""

import numpy as np
from pythonfmu3 import Dimension, Float64, Fmi3Causality, Fmi3Slave, Fmi3StepResult, Fmi3Variability


class Median(Fmi3Slave):
    """``samples`` [16, 4] in, ``votes`` [16] out, the medians plus ``bias`` [16]."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time = 0.0
        self.samples, self.votes, self.bias = np.zeros((16, 4)), np.zeros(16), np.zeros(16)
        self.register_variable(Float64("time", causality=Fmi3Causality.independent))
        shape = [Dimension(start="16"), Dimension(start="4")]
        given = {"causality": Fmi3Causality.input, "dimensions": shape, "setter": self._set}
        self.register_variable(Float64("samples", **given))
        self.register_variable(Float64("votes", causality=Fmi3Causality.output, dimensions=shape[:1]))
        fixed = {"causality": Fmi3Causality.parameter, "variability": Fmi3Variability.fixed}
        self.register_variable(Float64("bias", dimensions=shape[:1], setter=self._bias, **fixed))

    def _set(self, values):
        self.samples = np.reshape(values, (16, 4))

    def _bias(self, values):
        self.bias = np.array(values)

    def do_step(self, current_time, step_size):
        self.votes = np.median(self.samples, axis=1) + self.bias
        return Fmi3StepResult()
