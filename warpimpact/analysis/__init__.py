"""From a Dataset to numbers and their text: estimates, summary, effectiveness, comparison.

Change what is computed from a result here; a new measure belongs in measures/vocabulary.py, and the
uncertainty of a number in statistics. It imports campaign, results and the rooms below them, and computes no hit.
"""
