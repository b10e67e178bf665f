"""Results as files for other programs: CSV for spreadsheets, VTK for ParaView.

Change what these files contain here; results writes the netCDF file. It imports analysis and the rooms below it, but
neither plotting nor report.
"""
