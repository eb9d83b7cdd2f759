"""Wind, wakes and bodies."""
