"""The public package composed of its rooms: log and flight with figures, tables and the conclusion of their score."""
