"""What drives: trained policies and classical laws of following.

In: leader speed, speed, gap, target time gap and grade. Out: engine and brake commands in the truck's units.
"""
