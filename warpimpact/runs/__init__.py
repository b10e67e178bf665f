"""From a validated campaign to its complete result: tasks, chunks, resume, workers, clusters, replay.

Change the steps of a run here; what a campaign may contain is in campaign, the file of a result in results. It imports
campaign, results and the rooms below them.
"""
