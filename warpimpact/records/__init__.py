"""The variables and attributes of a map of hits, the kinds of files, and the outcomes of shots.

Change what is known of a quantity here: its name, units and meaning, how it changes under a mirror image, when it is
recorded, and how its column is filled from what a device returned. It imports scene and kernels, and knows no
Dataset and no file.
"""
