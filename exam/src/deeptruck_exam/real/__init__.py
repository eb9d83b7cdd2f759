"""Real logs: pairs of drives, and drives whose road is withheld from the tool."""
