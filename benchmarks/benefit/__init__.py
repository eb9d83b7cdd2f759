"""What a corrected simulator is good for: policies trained on it and on the old one, on the true truck."""
