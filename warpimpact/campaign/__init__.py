"""From a campaign file, or that in a result, to a validated campaign: its tables, what excludes what, its schema.

Change the tables of the campaign file here; what runs a campaign is in runs, physics in scene and solver. It imports
measures and the rooms below it.
"""
