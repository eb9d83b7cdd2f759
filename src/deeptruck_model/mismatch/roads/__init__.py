"""Roads: positions along shared roads, by GPS or slope, and recovered slopes of one or several vehicles."""
