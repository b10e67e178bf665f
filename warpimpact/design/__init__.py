"""A page on this machine where a plate is drawn and its hit map answers while a slider moves.

Change what the page asks, computes and shows here; a table or a map that a report has, too, belongs in report, a number
in analysis. It imports report and the rooms below it.
"""
