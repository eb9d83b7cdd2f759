"""What all packages share: errors, channels and units, the rule of writing, commands on a terminal, pages."""
