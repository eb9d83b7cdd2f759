"""Roads: places by positions or slopes, and recovered slopes of one or several vehicles."""
