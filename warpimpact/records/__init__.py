"""What is recorded of a shot: a module for each record, a line for each in the registry, and the outcomes they make.

Change what is known of a recorded quantity here: its name, units and meaning, how it changes under a mirror image, when
it is recorded, and how its column is filled from what a device returned. It imports scene and kernels, and knows no
Dataset and no file.
"""
