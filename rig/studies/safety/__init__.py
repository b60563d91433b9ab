"""The safety case: flown cut sets, the fault tree, the FMEA, and the flights that confirm the cut sets."""
