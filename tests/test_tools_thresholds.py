"""Figures of recordings: what is drawn for a flight."""

import numpy as np
from figures.thresholds import faulted

from rig.studies.thresholds.design import DataBlock


def test_the_faults_of_a_recording_do_not_depend_on_the_path_by_which_it_is_given():
    samples = np.random.default_rng(0).normal(size=(4, 3000))
    here, there = (faulted(DataBlock(name, samples, 120.0), 1) for name in ("../data/flight_1", "/elsewhere/flight_1"))
    other, _, onset = faulted(DataBlock("../data/flight_2", samples, 120.0), 1)

    np.testing.assert_array_equal(here[0], there[0])
    assert here[1:] == there[1:]
    assert onset != here[2]
    assert other.shape == here[0].shape
