"""Rolling resistance and grip."""
