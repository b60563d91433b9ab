"""What a person sees of a flight: viewer, terminal, notebook, pages."""
