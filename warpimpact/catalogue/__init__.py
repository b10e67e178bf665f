"""Data: threats and materials by name, each with its sources and what is assumed of it.

Change what an entry says, or add a file of an entry, in threats/ and materials/; how a campaign takes a name is in
campaign. It imports scene.
"""
