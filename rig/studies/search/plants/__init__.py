"""The search over any plant: a Python function of numbers and signals, which returns times and columns.

plant_file.py     the plan: ranges, pieces of signals, requirements
plant_signal.py   a signal as the function gets it; plant_space.py  the unit cube of numbers and pieces
plant_call.py     one call of the function, in a process; plant_workers.py  these processes, and their time limit
plant_subject.py  requirements over columns
plant_rounds.py   simulations of a search, in a folder; run_plant_search.py  the search; plant_clusters.py  its finds,
                  simulated again; plant_smallest.py  the smallest input; plant_result.py  its figures
plant_page.py     the page; plant_words.py  inputs in words; plant_api.py  rig.search
No module here loads JSBSim.
"""
