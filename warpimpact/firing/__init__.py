"""Firing tests: V50 of fired shots, and what a simulated test would report of a target whose limits are computed.

Change the evaluation of shots, procedures and plans of proof here; a regression and its interval belong in statistics,
the search of limits in solver and studies. It imports studies and the rooms below it.
"""
