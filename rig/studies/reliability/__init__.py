"""Compute a probability per flight hour from failure rates and measured outcomes."""
