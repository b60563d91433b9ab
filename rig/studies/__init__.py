"""Many flights or trials of one plan."""
