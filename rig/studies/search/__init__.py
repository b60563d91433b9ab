"""The search for the worst case: random flights first, then CMA-ES in each arm, in the folder of a campaign.

space.py      the searched space: an arm is a combination of cases and listed values; its ranges are a unit cube
cma_es.py     CMA-ES in one arm, started again from the next-best random flight when it stagnates
rounds.py     the next flights: random ones, then rounds over the arms, in which the worse half of the arms pauses
objective.py  the minimised value: robustness of the requirements, then robustness of the vote and a slope of yes and no
search_plan.py  the flights as a campaign's plan, which grows
run_search.py  draw, fly the missing flights, evaluate
clusters.py    violating points around a best one
worst_cases.py of each cluster: the worst case, chosen and made small (shrink.py), then told on seeds that chose nothing
search_result.py  figures, scenario files; picture.py  the page; worst_flight.py  its flights
"""
