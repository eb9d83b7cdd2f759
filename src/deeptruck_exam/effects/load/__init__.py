"""What is carried or towed."""
