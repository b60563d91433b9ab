"""A voter with variables of its own names, for an FMU by PythonFMU (FMI 2.0): the median of each signal's channels."""

from statistics import median

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real

SIGNALS = ["rate_q", "rate_p", "rate_r", "n_z", "n_y", "n_x", "alpha", "beta"]
SIGNALS += ["p_static", "p_dynamic", "stick_x", "stick_y", "pedals", "theta", "phi", "psi"]


class Median(Fmi2Slave):
    """``<signal>_<channel>`` in, ``<signal>`` out: the vote of rate_q plus bias, of n_z times gain, ..."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        for signal in SIGNALS:
            for name in (signal, *(f"{signal}_{n}" for n in (1, 2, 3, 4))):
                causality = Fmi2Causality.output if name == signal else Fmi2Causality.input
                setattr(self, name, 0.0)
                self.register_variable(Real(name, causality=causality))
        fixed = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}
        self.bias, self.gain, self.turns, self.shift = 0.0, 1.0, 0, 0.0
        self.register_variable(Real("bias", **fixed))
        self.register_variable(Real("gain", **fixed))
        self.register_variable(Integer("turns", **fixed))
        self.register_variable(Real("shift", causality=Fmi2Causality.input))

    def do_step(self, current_time, step_size):
        for signal in SIGNALS:
            setattr(self, signal, median(getattr(self, f"{signal}_{n}") for n in (1, 2, 3, 4)))
        self.rate_q += self.bias
        self.n_z *= self.gain
        self.psi += 1e-3 * self.turns
        self.theta += self.shift
        return True
