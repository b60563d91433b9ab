"""A flight and a log for programs and notebooks."""
