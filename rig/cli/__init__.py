"""The command ``rig``: one file for each group of commands, ``main`` with the rest; ``show*`` print their results."""

import gc

# A command imports 200,000 objects that stay; the collector would look through them again and again, for a tenth of the
# command's time.  What is in no cycle, nearly everything, is freed without it.
gc.set_threshold(500_000, 10, 10)
