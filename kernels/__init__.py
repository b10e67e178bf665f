"""Warp device code: the physics of one core against one target, a file per physical stage.

Each stage file has a ``build`` function. It defines the small ``@wp.func`` pieces of the stage for one `Variant`, a
floating-point type and the physics that a scene needs, and returns all that it defines. One source serves both
precisions, and physics that a scene does not use costs nothing. Change physics here, beside its equation, and add a
closed form or an invariant to tests/verification. It imports Warp and no other room: nothing here opens a file or knows
a Dataset.
"""
