"""The safety case: sets of faults that are flown, the fault tree, the FMEA, and flights that confirm them."""
