"""What drives can identify at all: every law of the catalogue replayed along them."""
