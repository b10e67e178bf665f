"""The one room that knows the Dataset: its variables, units and attributes, its measures and its files.

Change names, units, meanings and the netCDF file here, and nowhere else; they are a contract with files that exist. It
imports statistics and the rooms below it.
"""
