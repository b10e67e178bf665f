"""The best designs of a target: free variables of a campaign → Pareto front of weight and protection.

Change the design file, its constraints, what a search computes and how it is confirmed here. The optimiser is a library
(the extra `optimise`), which optimise.py alone knows; a measure belongs in analysis, an interval in statistics. It
imports analysis and the rooms below it, neither identification nor studies.
"""
