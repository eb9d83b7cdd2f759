"""Surfaces and slopes."""
