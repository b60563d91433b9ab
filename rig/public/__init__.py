"""The public package composed of its rooms: flights, logs, faults, scores and votes for programs and notebooks."""
