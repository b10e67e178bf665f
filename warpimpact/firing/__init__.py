"""Simulated firing tests at a target whose map of limit velocities is known: what a test would report, and its error.

Change procedures, rules of fair hits, estimators and plans of proof here; a regression and its interval belong in
statistics, the search of limits in solver and studies. It imports studies and the rooms below it.
"""
