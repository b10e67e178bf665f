"""From a Dataset to numbers and their text: summary, effects, effectiveness, comparison.

Change what is computed from a result here; the uncertainty of a number belongs in statistics. It imports campaign and
the rooms below it, and draws nothing.
"""
