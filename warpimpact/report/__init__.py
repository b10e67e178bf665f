"""The HTML page of a report, for readers who have only a browser.

Change what the page says and how it looks here; a measure belongs in analysis, a figure in plotting. It imports
plotting, analysis and the rooms below them.
"""
