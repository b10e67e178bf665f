"""From numbers to intervals: estimates, differences, ratios, the worst tenth, the looks of a stop rule.

Change a formula here together with its source and with a test that counts how often its intervals contain the answer.
It imports NumPy and SciPy and no other room: it knows no Dataset.
"""
