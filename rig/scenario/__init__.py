"""What is flown, as a person wrote it."""
