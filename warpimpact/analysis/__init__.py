"""From a Dataset to numbers and their text: summary, effects, effectiveness, comparison, study.

Change what is asked of a result here; how certain a number is belongs in statistics. It imports campaign and the rooms
below it, and draws nothing.
"""
