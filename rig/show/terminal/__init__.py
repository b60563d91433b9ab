"""The redundancy page on the terminal, during a flight or from its log."""
