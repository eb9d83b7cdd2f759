"""Truck models by other authors, with one property concealed from the tool."""
