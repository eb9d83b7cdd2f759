"""What a command does on a terminal: errors in one line, progress, and Ctrl-C."""
