"""Many flights or trials of one plan.

campaign/     flights of one plan in one table; the others stand on it
search/       the worst case that a campaign's space holds
benchmark/    managers at one false-isolation rate, on the same trials
reliability/  from rates and measured outcomes to a probability per flight hour
safety/       fault tree, cut sets, FMEA
thresholds/   thresholds from recordings and a budget of false isolations
papers/       published results computed again
"""
