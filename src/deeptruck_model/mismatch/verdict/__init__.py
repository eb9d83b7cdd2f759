"""From numbers to one verdict: findings, where they act, and what is concluded."""
