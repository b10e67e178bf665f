"""Warp device code: the physics of one core against one plate, a file per physical stage.

Each stage file has a ``build`` function that defines its small ``@wp.func`` pieces for one `Variant`
(floating-point type and the physics that a scene needs), so that one source serves both precisions and what
a scene leaves out costs nothing. Change physics here, beside its equation, with a closed form or an invariant
in tests/verification. It imports Warp and numbers, and no other room: nothing here opens a file or knows a
Dataset.
"""
