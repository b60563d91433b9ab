"""What every room may use: text, files, console, progress, interrupts, versions, permission to run a user's code."""
