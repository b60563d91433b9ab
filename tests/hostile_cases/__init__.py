"""Hostile input for every command: cases, the process of each, and its failures (docs/project/fuzzing-and-cost.md)."""
