"""From a scene and shots to outcomes: what a method is, and the fast law with its resolution, rings, tile and march.

Change how a scene becomes arrays and how a device computes them here; the physics of a step belongs in kernels. It
imports records, scene and kernels, and knows no Dataset and no file.
"""
