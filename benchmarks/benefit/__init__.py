"""The benefit of a corrected simulator: policies trained on it and on the old one drive the true truck."""
