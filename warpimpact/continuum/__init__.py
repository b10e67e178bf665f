"""From a scene and shots to outcomes by finite elements: mesh of the layers about each hit, march, energy, status.

Change how a target becomes a mesh, and what a hit by the continuum tells, here; the physics of an element belongs in
kernels/continuum. It imports solver, records, scene and kernels, and knows no Dataset and no file.
"""
