"""A voter with arrays of its own, for an FMU by PythonFMU3 (FMI 3.0): the median of each signal's channels."""

import numpy as np
from pythonfmu3 import Dimension, Float64, Fmi3Causality, Fmi3Slave, Fmi3StepResult


class Median(Fmi3Slave):
    """``samples`` [16, 4] in, ``votes`` [16] out."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time = 0.0
        self.samples, self.votes = np.zeros((16, 4)), np.zeros(16)
        self.register_variable(Float64("time", causality=Fmi3Causality.independent))
        shape = [Dimension(start="16"), Dimension(start="4")]
        given = {"causality": Fmi3Causality.input, "dimensions": shape, "setter": self._set}
        self.register_variable(Float64("samples", **given))
        self.register_variable(Float64("votes", causality=Fmi3Causality.output, dimensions=shape[:1]))

    def _set(self, values):
        self.samples = np.reshape(values, (16, 4))

    def do_step(self, current_time, step_size):
        self.votes = np.median(self.samples, axis=1)
        return Fmi3StepResult()
