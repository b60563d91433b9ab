"""From rates and measured outcomes to a probability per flight hour."""
