"""From a scene and shots to outcomes: device, resolution, rings, tile, inputs, marching, history.

Change how a scene becomes arrays and how a device computes them here; the physics of a step belongs in kernels. It
imports records, scene and kernels, and knows no Dataset and no file.
"""
