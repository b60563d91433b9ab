"""Hostile input for every command: cases, the process each runs in, and what counts as a failure (docs/hostile.md)."""
