"""The search for the worst case: random flights first, then CMA-ES in each arm, into the folder of a campaign.

space.py      what is searched: an arm is a combination of cases and listed values, its numbers a unit cube
cma_es.py     CMA-ES in one arm, started again from the next-best random flight when it stagnates
rounds.py     which flights come next: random ones, then rounds over the arms, of which the worse half rests
objective.py  what is made least: robustness of the requirements, ties by the robustness of the vote
search_plan.py  the flights as a campaign's plan, which grows
run_search.py  ask, fly what the folder lacks, tell; then confirm_worst.py, on new seeds, and shrink.py
search_result.py  figures, scenario file; picture.py  robustness over flights
"""
