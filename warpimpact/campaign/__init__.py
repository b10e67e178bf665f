"""From a campaign file to a complete result: validation, shards, resume, distribution, replay.

Change the tables of the campaign file and the steps of a run here; physics belongs below, in scene and solver. It
imports results and the rooms below it.
"""
