"""Results as files for other programs: CSV for spreadsheets, VTK for ParaView.

Change what these files hold here; the netCDF file is that of results. It imports analysis and the rooms below it, but
neither plotting nor report.
"""
