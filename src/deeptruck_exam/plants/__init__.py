"""Trucks that others wrote, with something of them concealed."""
