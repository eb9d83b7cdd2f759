"""The paper's experiments on the reference trucks, and classical models for comparison."""
