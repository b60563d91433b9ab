"""The search for the worst case: one region of finds after the other, in the folder of a campaign.

space.py      the searched space: an arm is a combination of cases and listed values; its ranges are a unit cube
rounds.py     the form of a method: rounds of draws, and what they are worth; the random method
regions.py    the method: a forest predicts what to fly next; cma_es.py, for comparison; methods.py  by their names
objective.py  the minimised value: robustness of the requirements, then robustness of the vote and a slope of yes and no
search_plan.py  the flights as a campaign's plan, which grows
open_loop.py  trials in place of flights; trials_first.py, before them
run_search.py  draw, fly the missing flights, evaluate
clusters.py    violating points around a best one
worst_cases.py of each cluster: the worst case, chosen and made small (shrink.py), then told on seeds that chose nothing
search_result.py  figures, scenario files; picture.py  the page; robustness_picture.py  its first picture;
                  worst_flight.py  its flights
"""
