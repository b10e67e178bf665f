"""What a number of a map means, and how sure it is: quantities, events, measures, their estimates, and references.

Change what may be asked of a result here; how a number becomes text or a figure is in analysis and plotting. It imports
records, statistics and the rooms below them.
"""
