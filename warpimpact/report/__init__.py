"""The HTML page of a report, for a person who has only a browser.

Change what the page says and how it looks here; a measure belongs in analysis, a figure in plotting. It imports
plotting, analysis and the rooms below them.
"""
