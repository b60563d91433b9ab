"""The command ``rig``: one file for each group of commands, ``main`` with the rest; ``show*`` print their results."""
