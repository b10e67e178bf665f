"""Device code of the continuum: explicit Lagrangian finite elements of a target and of what hits it
(docs/continuum.md).

Change the element, the flow, the erosion or the contact here, each beside its equation; what becomes a mesh is in the
room continuum. It imports Warp and the rigid body of the kernels.
"""
