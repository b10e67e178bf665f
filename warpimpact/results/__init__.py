"""The one room that knows the Dataset: its variables and attributes, its measures and its files.

Change the netCDF file here, and the variables that are not recorded per shot; they are a contract with files that
exist. What may be asked of a result is declared in vocabulary.py. It imports statistics and the rooms below it.
"""
