"""Controllers: trained policies and classical car-following laws.

Input: leader speed, speed, gap, target time gap and grade. Output: engine and brake commands in the truck's
units.
"""
