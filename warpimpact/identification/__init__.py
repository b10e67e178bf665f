"""From measured shots to parameters with their uncertainty: fit file → runs at many sets of parameters → posterior.

Change what may be fitted, how a measured shot is compared with computed ones, and how a posterior is gathered here; its
file belongs in results, the drawing of sets of parameters in statistics. It imports analysis and the rooms below it.
"""
