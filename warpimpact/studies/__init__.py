"""Questions that take many computations of a campaign, such as the limit velocity of every hit.

Change what is asked and how the answer is told here; the search itself belongs in solver, the shards in runs. It
imports analysis and the rooms below it.
"""
