"""The one room that knows the Dataset: its attributes, its measures and its files.

Change the netCDF file here, which is a contract with files that exist; its variables are in records. What may be asked
of a result is declared in vocabulary.py. It imports statistics and the rooms below it.
"""
