"""The Dataset of a map of hits, and its file.

Change the netCDF file here, which is a contract with files that exist; its variables, attributes and kinds are in
records, what may be asked of it in measures. It imports solver, measures and the rooms below them.
"""
