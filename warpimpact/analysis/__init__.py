"""From a Dataset to numbers and their text: estimates, summary, effectiveness, comparison.

Change what is computed from a result here; a new measure belongs in measures/vocabulary.py, and the
uncertainty of a number in statistics. It imports campaign and
the rooms below it, and draws nothing.
"""
